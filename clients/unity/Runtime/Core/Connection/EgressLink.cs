using System;
using System.Collections.Generic;
using System.Threading;

namespace Foottrack
{
    /// <summary>
    /// From the bus to here: subscribes, and knows when nothing is missed any more (SPEC, "Receiving from the first
    /// message on").
    /// </summary>
    internal sealed class EgressLink : Link
    {
        private static readonly byte[] Welcome = Utf8.Bytes("sys/welcome");

        private readonly List<byte[]> _prefixes = new List<byte[]>();
        private readonly Receiver _receiver;
        private readonly FrameBuffer _frames = new FrameBuffer();
        private volatile bool _live;
        private byte[] _token;
        private long _welcomes;

        public EgressLink(string host, int port, IEnumerable<string> prefixes, Receiver receiver)
            : base(host, port, "SUB")
        {
            _receiver = receiver;
            foreach (string prefix in prefixes)
            {
                _prefixes.Add(Utf8.Bytes(prefix));
            }
        }

        /// <summary>All subscriptions are in force.</summary>
        public bool IsLive { get { return _live; } }

        /// <summary>How often the bus was found; the number of losses is one less.</summary>
        public long Welcomes { get { return Interlocked.Read(ref _welcomes); } }

        protected override void Serve(ZmtpConnection connection)
        {
            connection.Write(ZmtpConnection.Subscribe, Welcome);
            foreach (byte[] prefix in _prefixes)
            {
                connection.Write(ZmtpConnection.Subscribe, prefix);
            }
            while (!IsStopping)
            {
                if (!connection.TryReceive(SliceMs, _frames))
                {
                    continue;
                }
                if (_frames.Count == 1 && _frames.FrameStartsWith(0, Welcome))
                {
                    OnWelcome(connection);
                }
                else
                {
                    _receiver.Receive(_frames);
                }
            }
        }

        protected override void Ended()
        {
            _live = false;
            _token = null;
        }

        private void OnWelcome(ZmtpConnection connection)
        {
            if (_frames.FrameIs(0, Welcome))
            {
                _token = Utf8.Bytes("sys/welcome/" + Guid.NewGuid().ToString("N"));
                connection.Write(ZmtpConnection.Subscribe, _token);
            }
            else if (_token != null && _frames.FrameIs(0, _token))
            {
                connection.Write(ZmtpConnection.Cancel, _token);
                _token = null;
                Interlocked.Increment(ref _welcomes);
                _live = true;
            }
        }
    }
}
