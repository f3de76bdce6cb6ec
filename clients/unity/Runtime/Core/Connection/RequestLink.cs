using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;
using System.Threading;

namespace Foottrack
{
    /// <summary>
    /// Asks the control socket what a game wants to know, or to have done. A DEALER, so that a calibration that takes a
    /// minute holds up nothing; apart from the connection that keeps the time. It begins with the first request.
    /// </summary>
    internal sealed class RequestLink : Link
    {
        private const int AnswerSliceMs = 10;

        private readonly FrameBuffer _frames = new FrameBuffer();
        private readonly MsgpackReader _reader = new MsgpackReader();
        private readonly object _gate = new object();
        private readonly Dictionary<long, ControlRequest> _waiting = new Dictionary<long, ControlRequest>();
        private bool _started;
        private long _asked;

        public RequestLink(string host, int port) : base(host, port, "DEALER")
        {
        }

        public ControlRequest Ask(string command, IDictionary<string, object> arguments, int timeoutMs)
        {
            byte[] payload = ControlRequest.Pack(command, arguments);
            lock (_gate)
            {
                var request = new ControlRequest(++_asked, command, payload, timeoutMs);
                _waiting[request.Id] = request;
                if (!_started)
                {
                    _started = true;
                    Start();
                }
                Monitor.Pulse(_gate);
                return request;
            }
        }

        protected override void Serve(ZmtpConnection connection)
        {
            while (!IsStopping)
            {
                bool any;
                foreach (ControlRequest request in Unsent(out any))
                {
                    request.IsSent = true;
                    byte[] framed = Framed(request);
                    connection.WriteRaw(framed, 0, framed.Length);
                }
                if (!any)
                {
                    lock (_gate)
                    {
                        Monitor.Wait(_gate, SliceMs);
                    }
                }
                while (connection.TryReceive(any ? AnswerSliceMs : 0, _frames))
                {
                    OnAnswer();
                }
            }
        }

        protected override void Ended()
        {
            lock (_gate)
            {
                foreach (ControlRequest request in new List<ControlRequest>(_waiting.Values))
                {
                    if (request.IsSent || IsStopping || request.IsDone)
                    {
                        _waiting.Remove(request.Id);
                        request.Fail(ControlRequest.Timeout, "the service went away before it answered '"
                            + request.Command + "'");
                    }
                }
            }
        }

        protected override void Wake()
        {
            lock (_gate)
            {
                Monitor.Pulse(_gate);
            }
        }

        private List<ControlRequest> Unsent(out bool any)
        {
            var unsent = new List<ControlRequest>();
            lock (_gate)
            {
                foreach (ControlRequest request in new List<ControlRequest>(_waiting.Values))
                {
                    if (request.IsDone)
                    {
                        _waiting.Remove(request.Id);
                    }
                    else if (!request.IsSent)
                    {
                        unsent.Add(request);
                    }
                }
                any = _waiting.Count > 0;
            }
            return unsent;
        }

        private void OnAnswer()
        {
            long id;
            ControlRequest request;
            if (_frames.Count != 3 || _frames.Length(1) != 0 || !TryId(out id))
            {
                return;
            }
            lock (_gate)
            {
                // The answer to a request that was given up is nobody's.
                if (!_waiting.TryGetValue(id, out request))
                {
                    return;
                }
                _waiting.Remove(id);
            }
            if (_frames.Length(2) > MessageDecoder.MaxPayloadBytes || !Read(request))
            {
                request.Fail(ControlRequest.BadAnswer, "the answer to '" + request.Command
                    + "' is neither a result nor an error");
            }
        }

        private bool TryId(out long id)
        {
            string text = Encoding.ASCII.GetString(_frames.Bytes, _frames.Offset(0), Math.Min(_frames.Length(0), 20));
            return long.TryParse(text, NumberStyles.None, CultureInfo.InvariantCulture, out id);
        }

        private bool Read(ControlRequest request)
        {
            _reader.Load(_frames.Bytes, _frames.Offset(2), _frames.Length(2));
            var answer = AnyValue.Read(_reader) as Dictionary<string, object>;
            object ok, value;
            if (_reader.Fault != Refusal.None || answer == null)
            {
                return false;
            }
            if (answer.TryGetValue("ok", out ok) && ok is bool && (bool)ok)
            {
                answer.TryGetValue("result", out value);
                request.Succeed(value);
                return true;
            }
            answer.TryGetValue("error", out value);
            var error = value as Dictionary<string, object>;
            object code, message;
            if (error == null || !error.TryGetValue("code", out code) || !error.TryGetValue("message", out message)
                || !(code is string) || !(message is string))
            {
                return false;
            }
            request.Fail((string)code, (string)message);
            return true;
        }

        /// <summary>Its number, an empty frame, and what is asked.</summary>
        private static byte[] Framed(ControlRequest request)
        {
            byte[] number = Encoding.ASCII.GetBytes(request.Id.ToString(CultureInfo.InvariantCulture));
            byte[] payload = request.Payload;
            var framed = new byte[2 + number.Length + 2 + 9 + payload.Length];
            int at = 0;
            framed[at++] = ZmtpConnection.More;
            framed[at++] = (byte)number.Length;
            Array.Copy(number, 0, framed, at, number.Length);
            at += number.Length;
            framed[at] = ZmtpConnection.More;
            at += 2;
            framed[at++] = ZmtpConnection.Long;
            for (int shift = 56; shift >= 0; shift -= 8)
            {
                framed[at++] = (byte)((long)payload.Length >> shift);
            }
            Array.Copy(payload, 0, framed, at, payload.Length);
            return framed;
        }
    }
}
