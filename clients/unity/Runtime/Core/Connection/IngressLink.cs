using System;
using System.Threading;

namespace Foottrack
{
    /// <summary>What became of a message that was to be published.</summary>
    public enum PublishResult
    {
        /// <summary>It waits to be sent, which takes a moment.</summary>
        Queued,
        /// <summary>The bus is not there.</summary>
        NoBus,
        /// <summary>The bus does not keep up.</summary>
        Full,
        /// <summary>A receiver would refuse it: a number that is not finite, a rotation that is none.</summary>
        Invalid,
    }

    /// <summary>
    /// From here to the bus: publishes once the bus has subscribed to everything (SPEC, "Publishing without losing the
    /// first messages").
    /// </summary>
    internal sealed class IngressLink : Link
    {
        /// <summary>Head poses of a second; more of them would only be stale.</summary>
        private const int Places = 128;
        private const int LookMs = 10;

        private readonly HeadEncoder _encoder;
        private readonly byte[][] _ring = new byte[Places][];
        private readonly int[] _lengths = new int[Places];
        private readonly object _gate = new object();
        private readonly FrameBuffer _frames = new FrameBuffer();
        private readonly long[] _counts = new long[(int)PublishResult.Invalid + 1];
        private int _first;
        private int _count;
        private bool _live;
        private long _sent;
        private long _cutOff;

        public IngressLink(string host, int port, HeadEncoder encoder) : base(host, port, "XPUB")
        {
            _encoder = encoder;
            for (int i = 0; i < Places; i++)
            {
                _ring[i] = new byte[encoder.MaxBytes];
            }
        }

        /// <summary>Whether the bus takes what is published now.</summary>
        public bool IsLive
        {
            get
            {
                lock (_gate)
                {
                    return _live;
                }
            }
        }

        /// <summary>Messages handed to the operating system.</summary>
        public long Sent { get { return Interlocked.Read(ref _sent); } }

        /// <summary>Messages that waited when the connection ended.</summary>
        public long CutOff { get { return Interlocked.Read(ref _cutOff); } }

        public long CountOf(PublishResult result)
        {
            return Interlocked.Read(ref _counts[(int)result]);
        }

        /// <summary>Never waits for the network.</summary>
        public PublishResult Publish(ref HeadPose head, long t, long tPub, bool valid)
        {
            PublishResult result;
            lock (_gate)
            {
                result = !HeadEncoder.IsSendable(ref head) ? PublishResult.Invalid
                    : !_live ? PublishResult.NoBus
                    : _count == Places ? PublishResult.Full
                    : PublishResult.Queued;
                if (result == PublishResult.Queued)
                {
                    int place = (_first + _count) % Places;
                    _lengths[place] = _encoder.Encode(_ring[place], ref head, t, tPub, valid);
                    _count++;
                    Monitor.Pulse(_gate);
                }
                else if (result != PublishResult.Invalid)
                {
                    _encoder.CountLost();
                }
            }
            Interlocked.Increment(ref _counts[(int)result]);
            return result;
        }

        protected override void Serve(ZmtpConnection connection)
        {
            while (!IsStopping)
            {
                while (connection.TryReceive(0, _frames))
                {
                    OnSubscription();
                }
                SendWaiting(connection);
                lock (_gate)
                {
                    if (_count == 0)
                    {
                        Monitor.Wait(_gate, LookMs);
                    }
                }
            }
        }

        protected override void Ended()
        {
            lock (_gate)
            {
                _live = false;
                Interlocked.Add(ref _cutOff, _count);
                _count = 0;
            }
        }

        protected override void Wake()
        {
            lock (_gate)
            {
                Monitor.Pulse(_gate);
            }
        }

        private void SendWaiting(ZmtpConnection connection)
        {
            while (true)
            {
                int place;
                lock (_gate)
                {
                    if (_count == 0)
                    {
                        return;
                    }
                    place = _first;
                }
                // Its place stays taken while it is sent, without the lock.
                connection.WriteRaw(_ring[place], 0, _lengths[place]);
                Interlocked.Increment(ref _sent);
                lock (_gate)
                {
                    _first = (_first + 1) % Places;
                    _count--;
                }
            }
        }

        /// <summary>Only what concerns everything is of interest: the ingress wants all or nothing.</summary>
        private void OnSubscription()
        {
            if (_frames.Count != 1 || _frames.Length(0) != 1)
            {
                return;
            }
            byte what = _frames.Bytes[_frames.Offset(0)];
            lock (_gate)
            {
                _live = what == ZmtpConnection.Subscribe || (_live && what != ZmtpConnection.Cancel);
            }
        }
    }
}
