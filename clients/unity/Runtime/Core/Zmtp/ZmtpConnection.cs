using System;
using System.Threading;

namespace Foottrack
{
    /// <summary>
    /// A connection that speaks as much of ZMTP 3.0 as SPEC's "bytes of a connection" asks for, and understands 3.1's
    /// PING, SUBSCRIBE and CANCEL. Belongs to one thread.
    /// </summary>
    internal sealed class ZmtpConnection : IDisposable
    {
        public const byte More = 1, Long = 2, Command = 4;
        public const byte Subscribe = 1, Cancel = 0;

        /// <summary>A peer that sends larger frames than the service itself would take is not one of ours.</summary>
        private const long MaxFrameBytes = 4 * 1024 * 1024;
        private const int GreetingBytes = 64;
        private const int SignatureBytes = 11;
        private const int MechanismAt = 12;
        private const int MechanismBytes = 20;

        private static readonly byte[] Ready = Utf8.Bytes("\u0005READY");
        private static readonly byte[] Error = Utf8.Bytes("\u0005ERROR");
        private static readonly byte[] Ping = Utf8.Bytes("\u0004PING");
        private static readonly byte[] Pong = Utf8.Bytes("\u0004PONG");
        private static readonly byte[] SubscribeCommand = Utf8.Bytes("\u0009SUBSCRIBE");
        private static readonly byte[] CancelCommand = Utf8.Bytes("\u0006CANCEL");

        private readonly ZmtpStream _stream;
        private readonly byte[] _command = new byte[256];
        private readonly byte[] _out = new byte[9 + 256];

        /// <summary>Connects and shakes hands. Throws LinkException or SocketException.</summary>
        public ZmtpConnection(string host, int port, string socketType, WaitHandle stop, byte[] buffer)
        {
            _stream = new ZmtpStream(host, port, stop, buffer);
            try
            {
                Greet();
                Write(MakeReady(socketType), Command);
                AwaitReady(PeersOf(socketType));
            }
            catch
            {
                _stream.Dispose();
                throw;
            }
        }

        public void Dispose()
        {
            _stream.Dispose();
        }

        /// <summary>From any thread: the owner's next read or write fails.</summary>
        public void Abort()
        {
            _stream.Abort();
        }

        /// <summary>The next message, when it begins within so long. Answers commands on the way.</summary>
        public bool TryReceive(int milliseconds, FrameBuffer frames)
        {
            frames.Clear();
            if (!_stream.Wait(milliseconds))
            {
                return false;
            }
            while (true)
            {
                int flags;
                long length = ReadHeader(out flags);
                if ((flags & Command) != 0)
                {
                    if (IsMessage(length, frames))
                    {
                        return true;
                    }
                    if (frames.Count == 0)
                    {
                        return false;
                    }
                    continue;
                }
                int at = frames.Add((int)length);
                if (at < 0)
                {
                    _stream.Drain(length);
                }
                else
                {
                    _stream.Read(frames.Bytes, at, (int)length);
                }
                if ((flags & More) == 0)
                {
                    return true;
                }
            }
        }

        /// <summary>Bytes that already have their frames' headers.</summary>
        public void WriteRaw(byte[] bytes, int offset, int count)
        {
            _stream.Write(bytes, offset, count);
        }

        /// <summary>One frame.</summary>
        public void Write(byte[] content, byte flags)
        {
            int length = content.Length;
            var framed = new byte[2 + length];
            framed[0] = flags;
            framed[1] = (byte)length;
            Array.Copy(content, 0, framed, 2, length);
            _stream.Write(framed, 0, framed.Length);
        }

        /// <summary>A subscription, or its end.</summary>
        public void Write(byte what, byte[] prefix)
        {
            var content = new byte[1 + prefix.Length];
            content[0] = what;
            Array.Copy(prefix, 0, content, 1, prefix.Length);
            Write(content, 0);
        }

        private static byte[] MakeReady(string socketType)
        {
            byte[] name = Utf8.Bytes("Socket-Type"), value = Utf8.Bytes(socketType);
            var ready = new byte[Ready.Length + 1 + name.Length + 4 + value.Length];
            int at = Ready.Length;
            Array.Copy(Ready, ready, at);
            ready[at++] = (byte)name.Length;
            Array.Copy(name, 0, ready, at, name.Length);
            at += name.Length + 3;
            ready[at++] = (byte)value.Length;
            Array.Copy(value, 0, ready, at, value.Length);
            return ready;
        }

        private void Greet()
        {
            var greeting = new byte[GreetingBytes];
            greeting[0] = 0xff;
            greeting[9] = 0x7f;
            greeting[10] = 3;
            Array.Copy(Utf8.Bytes("NULL"), 0, greeting, MechanismAt, 4);
            _stream.Write(greeting, 0, greeting.Length);
            _stream.Read(greeting, 0, SignatureBytes);
            if (greeting[0] != 0xff || (greeting[9] & 1) == 0)
            {
                throw Violation("is no ZeroMQ socket");
            }
            if (greeting[10] < 3)
            {
                throw Violation("speaks ZMTP " + greeting[10] + ", and 3 is needed");
            }
            _stream.Read(greeting, SignatureBytes, GreetingBytes - SignatureBytes);
            string mechanism = System.Text.Encoding.ASCII.GetString(greeting, MechanismAt, MechanismBytes).TrimEnd('\0');
            if (mechanism != "NULL")
            {
                throw Violation("wants the security mechanism " + mechanism + ": go through `foottrack relay`");
            }
        }

        private static string[] PeersOf(string socketType)
        {
            switch (socketType)
            {
                case "SUB": return new[] { "XPUB", "PUB" };
                case "XPUB": return new[] { "XSUB", "SUB" };
                default: return new[] { "ROUTER", "REP" };
            }
        }

        private void AwaitReady(string[] peers)
        {
            int flags;
            long length = ReadHeader(out flags);
            ReadCommand(length);
            if ((flags & Command) == 0 || !CommandIs(Ready, length))
            {
                throw Violation(CommandIs(Error, length) ? "refused: " + Reason(length) : "did not say READY");
            }
            string type = SocketType((int)Math.Min(length, _command.Length));
            if (Array.IndexOf(peers, type) < 0)
            {
                throw Violation("is a socket of type " + (type ?? "unknown") + ", and " + peers[0] + " is due");
            }
        }

        /// <summary>Null in a READY that says none, or is cut short.</summary>
        private string SocketType(int end)
        {
            int at = Ready.Length;
            string type = null;
            while (at < end)
            {
                int name = at + 1, value = name + _command[at] + 4;
                if (value > end)
                {
                    return null;
                }
                int length = _command[value - 1];
                if (_command[value - 2] + _command[value - 3] + _command[value - 4] != 0 || length > end - value)
                {
                    return null;
                }
                // Names are told apart without case (RFC 23).
                string key = Utf8.Text(_command, name, value - 4 - name);
                if (string.Equals(key, "Socket-Type", StringComparison.OrdinalIgnoreCase))
                {
                    type = Utf8.Text(_command, value, length);
                }
                at = value + length;
            }
            return type;
        }

        private long ReadHeader(out int flags)
        {
            flags = _stream.ReadByte();
            long length = (flags & Long) != 0 ? _stream.ReadBigEndian(8) : _stream.ReadByte();
            if ((flags & ~(More | Long | Command)) != 0)
            {
                throw Violation("sent a frame that is none");
            }
            if (length < 0 || length > MaxFrameBytes)
            {
                throw Violation("sent a frame of more than " + MaxFrameBytes + " bytes");
            }
            return length;
        }

        /// <summary>Obeys a command. What is a command in 3.1 and a message in 3.0 becomes that message.</summary>
        private bool IsMessage(long length, FrameBuffer frames)
        {
            ReadCommand(length);
            if (CommandIs(Ping, length) && length >= Ping.Length + 2)
            {
                int context = (int)Math.Min(length, _command.Length) - Ping.Length - 2;
                _out[0] = Command;
                _out[1] = (byte)(Pong.Length + context);
                Array.Copy(Pong, 0, _out, 2, Pong.Length);
                Array.Copy(_command, Ping.Length + 2, _out, 2 + Pong.Length, context);
                _stream.Write(_out, 0, 2 + Pong.Length + context);
            }
            else if (CommandIs(Error, length))
            {
                throw Violation("hangs up: " + Reason(length));
            }
            else if (frames.Count == 0 && CommandIs(SubscribeCommand, length))
            {
                TakeSubscription(Subscribe, SubscribeCommand.Length, (int)length, frames);
                return true;
            }
            else if (frames.Count == 0 && CommandIs(CancelCommand, length))
            {
                TakeSubscription(Cancel, CancelCommand.Length, (int)length, frames);
                return true;
            }
            return false;
        }

        private void TakeSubscription(byte what, int from, int length, FrameBuffer frames)
        {
            int prefix = Math.Min(length, _command.Length) - from;
            int at = frames.Add(1 + prefix);
            frames.Bytes[at] = what;
            Array.Copy(_command, from, frames.Bytes, at + 1, prefix);
        }

        /// <summary>Its beginning, into the scratch buffer; no command that matters is longer.</summary>
        private void ReadCommand(long length)
        {
            int kept = (int)Math.Min(length, _command.Length);
            _stream.Read(_command, 0, kept);
            _stream.Drain(length - kept);
        }

        private bool CommandIs(byte[] name, long length)
        {
            return length >= name.Length && Utf8.AreEqual(name, _command, 0, name.Length);
        }

        private string Reason(long length)
        {
            int most = Math.Min((int)Math.Min(length, _command.Length) - Error.Length - 1, _command[Error.Length]);
            return most > 0 ? Utf8.Text(_command, Error.Length + 1, most) : "no reason given";
        }

        private LinkException Violation(string what)
        {
            return new LinkException(LinkException.Cause.Violation, _stream.Where + " " + what);
        }
    }
}
