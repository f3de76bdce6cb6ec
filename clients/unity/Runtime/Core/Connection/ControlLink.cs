using System;
using System.Threading;

namespace Foottrack
{
    /// <summary>
    /// Asks the control socket who serves, and bursts of `time` (SPEC, sections 3 and 7). A REQ without its answer is
    /// stuck, so its connection is given up.
    /// </summary>
    internal sealed class ControlLink : Link
    {
        private const int AnswerMs = 500;
        private const int PeriodMs = 2000;

        private readonly TimeSync _time;
        private readonly FrameBuffer _frames = new FrameBuffer();
        private readonly MsgpackReader _reader = new MsgpackReader();
        private readonly byte[] _hello = Request(Names.Hello);
        private readonly byte[] _ask = Request(Names.Time);
        private readonly object _gate = new object();
        private string _session = "";
        private long _badAnswers;

        public ControlLink(string host, int port, TimeSync time) : base(host, port, "REQ")
        {
            _time = time;
        }

        /// <summary>Id of the service's run; empty before it is known.</summary>
        public string Session
        {
            get
            {
                lock (_gate)
                {
                    return _session;
                }
            }
        }

        public long BadAnswers { get { return Interlocked.Read(ref _badAnswers); } }

        /// <summary>Another service's clock may be another: what was known of the old one's is thrown away.</summary>
        public void OnSession(Session session)
        {
            lock (_gate)
            {
                if (session.Id != _session)
                {
                    _time.Forget();
                    _session = session.Id;
                }
            }
        }

        protected override void Serve(ZmtpConnection connection)
        {
            Ask(connection, _hello);
            Session session = Result(SystemReader.Session);
            if (session.Protocol.Major != MessageDecoder.ProtocolMajor)
            {
                throw new LinkException(
                    LinkException.Cause.Violation,
                    "the service speaks protocol " + session.Protocol.Major + " and this package "
                    + MessageDecoder.ProtocolMajor + ": update the older one");
            }
            OnSession(session);
            while (!IsStopping)
            {
                Measure(connection);
                Rest(connection);
            }
        }

        private void Measure(ZmtpConnection connection)
        {
            try
            {
                for (int i = 0; i < TimeSync.Burst && !IsStopping; i++)
                {
                    long sent = OwnClock.NowNs;
                    Ask(connection, _ask);
                    long received = OwnClock.NowNs;
                    _time.OnExchange(sent, Result(Time), received);
                }
            }
            finally
            {
                _time.OnBurstEnd();
            }
        }

        /// <summary>Between bursts: whoever PINGs is answered, and nothing else is due.</summary>
        private void Rest(ZmtpConnection connection)
        {
            for (int waited = 0; waited < PeriodMs && !IsStopping; waited += SliceMs)
            {
                if (connection.TryReceive(SliceMs, _frames))
                {
                    throw Bad("an answer that nobody asked for");
                }
            }
        }

        /// <summary>Sends a request and waits for its answer.</summary>
        private void Ask(ZmtpConnection connection, byte[] request)
        {
            long until = OwnClock.NowNs + AnswerMs * 1000000L;
            connection.WriteRaw(request, 0, request.Length);
            while (!connection.TryReceive(SliceMs, _frames))
            {
                if (IsStopping || OwnClock.NowNs > until)
                {
                    throw new LinkException(LinkException.Cause.Stall, "the service does not answer requests");
                }
            }
            if (_frames.Count != 2 || _frames.Length(0) != 0 || _frames.Length(1) > MessageDecoder.MaxPayloadBytes)
            {
                throw Bad("an answer that is none");
            }
        }

        /// <summary>What is under `result` in an answer that is ok.</summary>
        private T Result<T>(Func<MsgpackReader, T> read)
        {
            T result = default(T);
            bool ok = false, any = false;
            _reader.Load(_frames.Bytes, _frames.Offset(1), _frames.Length(1));
            for (int left = _reader.EnterMap(); left > 0; left--)
            {
                _reader.ReadKey();
                if (_reader.KeyIs(Names.Ok)) { ok = _reader.ReadBool(); }
                else if (_reader.KeyIs(Names.Result)) { result = read(_reader); any = true; }
                else { _reader.Skip(); }
            }
            if (_reader.Fault != Refusal.None || !ok || !any)
            {
                throw Bad("an error, or not what was asked for");
            }
            return result;
        }

        private static long Time(MsgpackReader r)
        {
            long t = 0;
            bool seen = false;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.T)) { t = r.ReadInt(); seen = true; }
                else { r.Skip(); }
            }
            r.Require(seen);
            return t;
        }

        private LinkException Bad(string what)
        {
            Interlocked.Increment(ref _badAnswers);
            return new LinkException(LinkException.Cause.Violation, "the service answers with " + what);
        }

        /// <summary>With the frames' headers.</summary>
        private static byte[] Request(byte[] command)
        {
            var bytes = new byte[64];
            var writer = new MsgpackWriter();
            const int headers = 4;
            writer.Begin(bytes, headers);
            writer.Map(2);
            writer.Text(Names.Cmd);
            writer.Text(command);
            writer.Text(Names.Args);
            writer.Map(0);
            Array.Resize(ref bytes, writer.Position);
            bytes[0] = ZmtpConnection.More;
            bytes[3] = (byte)(bytes.Length - headers);
            return bytes;
        }
    }
}
