using System;
using System.Net;
using System.Net.Sockets;
using System.Threading;

namespace Foottrack
{
    /// <summary>
    /// Bytes over TCP, for one thread that may wait. Whatever the peer does, nothing here waits longer than
    /// <see cref="StallMs"/> without progress, nor after the stop was signalled.
    /// </summary>
    internal sealed class ZmtpStream : IDisposable
    {
        /// <summary>A peer that begins something and does not go on for so long is given up.</summary>
        public const int StallMs = 5000;
        private const int SliceMs = 50;
        private const int SendMs = 1000;
        public const int BufferBytes = 64 * 1024;

        private readonly Socket _socket;
        private readonly WaitHandle _stop;
        private readonly byte[] _in;
        private int _from;
        private int _to;

        /// <summary>`buffer` is for what comes: its owner lends it to one connection after another.</summary>
        public ZmtpStream(string host, int port, WaitHandle stop, byte[] buffer)
        {
            _stop = stop;
            _in = buffer;
            Where = host + ":" + port;
            _socket = Open(Resolve(host), port);
        }

        /// <summary>For messages to a person.</summary>
        public readonly string Where;

        public void Dispose()
        {
            _socket.Close();
        }

        public void Abort()
        {
            try
            {
                _socket.Shutdown(SocketShutdown.Both);
            }
            catch (Exception e) when (e is SocketException || e is ObjectDisposedException)
            {
                // It has ended by itself.
            }
        }

        /// <summary>Whether at least one byte came within so long.</summary>
        public bool Wait(int milliseconds)
        {
            return _from < _to || (_socket.Poll(1000 * milliseconds, SelectMode.SelectRead) && Fill());
        }

        public byte ReadByte()
        {
            Need(1);
            return _in[_from++];
        }

        public long ReadBigEndian(int width)
        {
            long value = 0;
            for (int i = 0; i < width; i++)
            {
                value = (value << 8) | ReadByte();
            }
            return value;
        }

        public void Read(byte[] bytes, int offset, int count)
        {
            while (count > 0)
            {
                Need(1);
                int there = Math.Min(count, _to - _from);
                Buffer.BlockCopy(_in, _from, bytes, offset, there);
                _from += there;
                offset += there;
                count -= there;
            }
        }

        public void Drain(long count)
        {
            while (count > 0)
            {
                Need(1);
                int there = (int)Math.Min(count, _to - _from);
                _from += there;
                count -= there;
            }
        }

        public void Write(byte[] bytes, int offset, int count)
        {
            try
            {
                while (count > 0)
                {
                    int sent = _socket.Send(bytes, offset, count, SocketFlags.None);
                    offset += sent;
                    count -= sent;
                }
            }
            catch (SocketException e) when (IsTimeout(e.SocketErrorCode))
            {
                throw new LinkException(LinkException.Cause.Stall, Where + " takes nothing any more");
            }
        }

        private void Need(int count)
        {
            if (_to - _from >= count)
            {
                return;
            }
            for (int waited = 0; waited < StallMs; waited += SliceMs)
            {
                if (_socket.Poll(1000 * SliceMs, SelectMode.SelectRead))
                {
                    Fill();
                    return;
                }
                if (_stop.WaitOne(0))
                {
                    throw new LinkException(LinkException.Cause.Lost, "stopped");
                }
            }
            throw new LinkException(LinkException.Cause.Stall, Where + " began a message and stalled");
        }

        private static bool IsTimeout(SocketError error)
        {
            return error == SocketError.TimedOut || error == SocketError.WouldBlock;
        }

        private bool Fill()
        {
            _from = 0;
            _to = _socket.Receive(_in, 0, _in.Length, SocketFlags.None);
            if (_to == 0)
            {
                throw new LinkException(LinkException.Cause.Lost, "the connection to " + Where + " ended");
            }
            return true;
        }

        private IPAddress[] Resolve(string host)
        {
            IPAddress literal;
            return IPAddress.TryParse(host, out literal) ? new[] { literal } : Dns.GetHostAddresses(host);
        }

        private Socket Open(IPAddress[] addresses, int port)
        {
            foreach (IPAddress address in addresses)
            {
                var socket = new Socket(address.AddressFamily, SocketType.Stream, ProtocolType.Tcp);
                if (TryConnect(socket, new IPEndPoint(address, port)))
                {
                    socket.NoDelay = true;
                    socket.SendTimeout = SendMs;
                    socket.SetSocketOption(SocketOptionLevel.Socket, SocketOptionName.KeepAlive, true);
                    return socket;
                }
                socket.Close();
            }
            throw new LinkException(
                LinkException.Cause.Lost, "nobody listens at " + Where + ": is the foottrack service running?");
        }

        private bool TryConnect(Socket socket, EndPoint endpoint)
        {
            try
            {
                IAsyncResult pending = socket.BeginConnect(endpoint, null, null);
                if (WaitHandle.WaitAny(new[] { pending.AsyncWaitHandle, _stop }, StallMs) != 0)
                {
                    return false;
                }
                socket.EndConnect(pending);
                return true;
            }
            catch (SocketException)
            {
                return false;
            }
        }
    }
}
