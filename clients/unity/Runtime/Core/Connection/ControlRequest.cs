using System;
using System.Collections.Generic;

namespace Foottrack
{
    /// <summary>
    /// Something that the service was asked (SPEC, section 7). Look at <see cref="IsDone"/> once a frame, or wait for it
    /// in a coroutine. Any thread may look.
    /// </summary>
    public sealed class ControlRequest
    {
        /// <summary>What <see cref="Code"/> is where no answer came in time; whether it was carried out is not known.</summary>
        public const string Timeout = "timeout";
        /// <summary>What it is where something came that is no answer.</summary>
        public const string BadAnswer = "bad_answer";

        private readonly object _gate = new object();
        private readonly long _deadlineNs;
        private bool _done;
        private object _result;
        private string _code = "";
        private string _message = "";

        internal ControlRequest(long id, string command, byte[] payload, int timeoutMs)
        {
            Id = id;
            Command = command;
            Payload = payload;
            _deadlineNs = OwnClock.NowNs + timeoutMs * 1000000L;
        }

        public string Command { get; private set; }

        /// <summary>Answered, refused, or given up.</summary>
        public bool IsDone
        {
            get
            {
                if (OwnClock.NowNs > _deadlineNs)
                {
                    Fail(Timeout, "no answer to '" + Command + "' in time: is the service running?");
                }
                lock (_gate)
                {
                    return _done;
                }
            }
        }

        /// <summary>Whether it was answered with a result.</summary>
        public bool IsOk { get { return IsDone && _code.Length == 0; } }

        /// <summary>
        /// Maps are Dictionary&lt;string, object&gt;, arrays object[], numbers long or double; the others string, bool,
        /// byte[] and null. Null without an answer.
        /// </summary>
        public object Result { get { return IsDone ? _result : null; } }

        /// <summary>Why not, for a program: a code of SPEC's section 7, or one of the above. Empty when it is ok.</summary>
        public string Code { get { return IsDone ? _code : ""; } }

        /// <summary>Why not, for a person.</summary>
        public string Message { get { return IsDone ? _message : ""; } }

        internal long Id { get; private set; }
        internal byte[] Payload { get; private set; }
        internal bool IsSent { get; set; }

        internal void Succeed(object result)
        {
            Finish(result, "", "");
        }

        internal void Fail(string code, string message)
        {
            Finish(null, code, message);
        }

        /// <summary>The bytes of a request. Throws ArgumentException for values that have no place in one.</summary>
        internal static byte[] Pack(string command, IDictionary<string, object> arguments)
        {
            if (arguments != null && arguments.Count > 15)
            {
                throw new ArgumentException("no command takes so many arguments");
            }
            int room = 32 + 3 * command.Length;
            foreach (KeyValuePair<string, object> pair in arguments ?? new Dictionary<string, object>())
            {
                var text = pair.Value as string;
                room += 16 + 3 * pair.Key.Length + (text == null ? 0 : 3 * text.Length);
            }
            var bytes = new byte[room];
            var writer = new MsgpackWriter();
            writer.Begin(bytes, 0);
            writer.Map(2);
            writer.Text(Names.Cmd);
            Text(writer, command);
            writer.Text(Names.Args);
            writer.Map(arguments == null ? 0 : arguments.Count);
            foreach (KeyValuePair<string, object> pair in arguments ?? new Dictionary<string, object>())
            {
                Text(writer, pair.Key);
                Value(writer, pair.Key, pair.Value);
            }
            Array.Resize(ref bytes, writer.Position);
            return bytes;
        }

        private void Finish(object result, string code, string message)
        {
            lock (_gate)
            {
                if (!_done)
                {
                    _result = result;
                    _code = code;
                    _message = message;
                    _done = true;
                }
            }
        }

        private static void Value(MsgpackWriter writer, string key, object value)
        {
            if (value == null) { writer.Nil(); }
            else if (value is bool) { writer.Bool((bool)value); }
            else if (value is int || value is long) { writer.Int(Convert.ToInt64(value)); }
            else if (value is float || value is double) { writer.Float(Convert.ToDouble(value)); }
            else if (value is string) { Text(writer, (string)value); }
            else { throw new ArgumentException("'" + key + "' is neither a number, a string, a bool nor null"); }
        }

        private static void Text(MsgpackWriter writer, string text)
        {
            byte[] utf8 = Utf8.Bytes(text);
            if (utf8.Length > 255)
            {
                throw new ArgumentException("a text of more than 255 bytes");
            }
            writer.Text(utf8);
        }
    }
}
