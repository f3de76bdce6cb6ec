namespace Foottrack
{
    /// <summary>The newest of a stream: written by the receiving thread, read by any.</summary>
    internal sealed class Latest<T> where T : struct
    {
        private readonly object _gate = new object();
        private Received<T> _newest;
        private bool _any;

        public void Put(Envelope envelope, ref T body, long arrivalNs)
        {
            lock (_gate)
            {
                _newest.Envelope = envelope;
                _newest.Body = body;
                _newest.ArrivalNs = arrivalNs;
                _any = true;
            }
        }

        public bool TryGet(out Received<T> newest)
        {
            lock (_gate)
            {
                newest = _newest;
                return _any;
            }
        }
    }

    /// <summary>Messages in their order. It grows up to its limit; beyond that the oldest are lost, and counted.</summary>
    internal sealed class Waiting<T>
    {
        private readonly object _gate = new object();
        private readonly int _most;
        private T[] _ring;
        private int _first;
        private int _count;
        private long _lost;

        public Waiting(int first, int most)
        {
            _ring = new T[first];
            _most = most;
        }

        public long Lost
        {
            get
            {
                lock (_gate)
                {
                    return _lost;
                }
            }
        }

        public void Put(T item)
        {
            lock (_gate)
            {
                if (_count == _ring.Length && _count < _most)
                {
                    Grow();
                }
                if (_count == _ring.Length)
                {
                    _first = (_first + 1) % _ring.Length;
                    _count--;
                    _lost++;
                }
                _ring[(_first + _count) % _ring.Length] = item;
                _count++;
            }
        }

        public bool TryTake(out T item)
        {
            lock (_gate)
            {
                item = default(T);
                if (_count == 0)
                {
                    return false;
                }
                item = _ring[_first];
                _ring[_first] = default(T);
                _first = (_first + 1) % _ring.Length;
                _count--;
                return true;
            }
        }

        private void Grow()
        {
            var larger = new T[System.Math.Min(2 * _ring.Length, _most)];
            for (int i = 0; i < _count; i++)
            {
                larger[i] = _ring[(_first + i) % _ring.Length];
            }
            _ring = larger;
            _first = 0;
        }
    }
}
