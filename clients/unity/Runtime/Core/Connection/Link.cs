using System;
using System.Net.Sockets;
using System.Threading;

namespace Foottrack
{
    /// <summary>
    /// A thread with a connection that comes back: a new try after a pause that grows. What it is for is in the
    /// classes that extend it.
    /// </summary>
    internal abstract class Link : IDisposable
    {
        private const int FirstPauseMs = 100;
        private const int LongestPauseMs = 2000;
        private const int JoinMs = 1000;

        /// <summary>How long a thread waits for bytes before it looks whether it should stop.</summary>
        protected const int SliceMs = 50;

        protected readonly ManualResetEvent Stopping = new ManualResetEvent(false);

        private readonly string _host;
        private readonly int _port;
        private readonly string _socketType;
        private readonly Thread _thread;
        private readonly byte[] _incoming = new byte[ZmtpStream.BufferBytes];
        private volatile ZmtpConnection _connection;
        private volatile string _fault = "";
        private volatile bool _ready;
        private long _connections;
        private long _violations;
        private long _stalls;
        private long _failures;

        protected Link(string host, int port, string socketType)
        {
            _host = host;
            _port = port;
            _socketType = socketType;
            _thread = new Thread(Run) { IsBackground = true, Name = "foottrack " + socketType };
        }

        /// <summary>Whether the connection stands.</summary>
        public bool IsReady { get { return _ready; } }

        /// <summary>Why the connection ended, or did not begin; empty while it stands.</summary>
        public string Fault { get { return _fault; } }

        public long Connections { get { return Interlocked.Read(ref _connections); } }
        public long Violations { get { return Interlocked.Read(ref _violations); } }
        public long Stalls { get { return Interlocked.Read(ref _stalls); } }
        public long Failures { get { return Interlocked.Read(ref _failures); } }

        public void Start()
        {
            _thread.Start();
        }

        /// <summary>Returns at once; the thread ends soon.</summary>
        public void Stop()
        {
            Stopping.Set();
            ZmtpConnection connection = _connection;
            if (connection != null)
            {
                connection.Abort();
            }
            Wake();
        }

        /// <summary>Waits for the thread's end, but not for long: it is a background thread.</summary>
        public void Dispose()
        {
            Stop();
            if (_thread.IsAlive)
            {
                _thread.Join(JoinMs);
            }
        }

        protected bool IsStopping { get { return Stopping.WaitOne(0); } }

        /// <summary>Serves a connection until it ends by an exception or the link is stopped.</summary>
        protected abstract void Serve(ZmtpConnection connection);

        protected virtual void Ended()
        {
        }

        protected virtual void Wake()
        {
        }

        private void Run()
        {
            int pause = FirstPauseMs;
            while (!IsStopping)
            {
                long opened = OwnClock.NowNs;
                Attempt();
                // A peer that only ever greets and hangs up is not asked more and more often.
                if (OwnClock.NowNs - opened > LongestPauseMs * 1000000L)
                {
                    pause = FirstPauseMs;
                }
                Stopping.WaitOne(pause);
                pause = Math.Min(2 * pause, LongestPauseMs);
            }
        }

        private void Attempt()
        {
            try
            {
                using (_connection = new ZmtpConnection(_host, _port, _socketType, Stopping, _incoming))
                {
                    Interlocked.Increment(ref _connections);
                    _fault = "";
                    _ready = true;
                    Serve(_connection);
                }
            }
            catch (LinkException e)
            {
                _fault = e.Message;
                Count(e.Why);
            }
            catch (SocketException e)
            {
                _fault = "the connection to " + _host + ":" + _port + " failed: " + e.Message;
            }
            catch (Exception e)
            {
                // A mistake of ours must not end the thread without a word.
                _fault = "internal error: " + e;
                Interlocked.Increment(ref _failures);
            }
            finally
            {
                _connection = null;
                _ready = false;
                Ended();
            }
        }

        private void Count(LinkException.Cause why)
        {
            if (why == LinkException.Cause.Violation)
            {
                Interlocked.Increment(ref _violations);
            }
            else if (why == LinkException.Cause.Stall)
            {
                Interlocked.Increment(ref _stalls);
            }
        }
    }
}
