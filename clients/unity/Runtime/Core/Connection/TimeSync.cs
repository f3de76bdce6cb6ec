using System;

namespace Foottrack
{
    /// <summary>The bus clock for who has another (SPEC, section 3). All values are ns. Any thread may ask.</summary>
    internal sealed class TimeSync
    {
        public const int Burst = 8;
        private const long MaxRoundTrip = 128000000;
        private const long MaxAge = 10000000000;
        /// <summary>Two clocks with crystals of 50 ppm each.</summary>
        private const double MaxDrift = 100e-6;

        private readonly object _gate = new object();
        private bool _known;
        private long _offset;
        private long _halfWidth;
        private long _at;
        private long _measuredAt;
        // Of the burst under way.
        private long _leastRoundTrip = long.MaxValue;
        private long _middle;
        private long _bus;

        /// <summary>One exchange: own clock before, bus clock, own clock after.</summary>
        public void OnExchange(long sent, long bus, long received)
        {
            long roundTrip = received - sent;
            if (roundTrip >= 0 && roundTrip <= MaxRoundTrip && roundTrip < _leastRoundTrip)
            {
                _leastRoundTrip = roundTrip;
                _middle = sent + roundTrip / 2;
                _bus = bus;
            }
        }

        /// <summary>The burst is complete, or has failed: takes its quickest exchange, if it has one.</summary>
        public void OnBurstEnd()
        {
            if (_leastRoundTrip == long.MaxValue)
            {
                return;
            }
            long found = _bus - _middle, halfWidth = (_leastRoundTrip + 1) / 2;
            _leastRoundTrip = long.MaxValue;
            lock (_gate)
            {
                long before = HalfWidthAt(_middle);
                _measuredAt = _middle;
                // Two that cannot both be right: a clock stood still, or the service is another one.
                if (!_known || halfWidth <= before || Distance(found, _offset) > (double)halfWidth + before)
                {
                    _offset = found;
                    _halfWidth = halfWidth;
                    _at = _middle;
                    _known = true;
                }
            }
        }

        /// <summary>The service is another one: its clock may be too.</summary>
        public void Forget()
        {
            _leastRoundTrip = long.MaxValue;
            lock (_gate)
            {
                _known = false;
                _offset = 0;
            }
        }

        /// <summary>Bus clock minus own clock; false, and 0, where it is not known. It may be known and not fresh.</summary>
        public bool TryGetOffset(out long offset)
        {
            lock (_gate)
            {
                offset = _offset;
                return _known;
            }
        }

        /// <summary>Whether stamps may be trusted.</summary>
        public bool IsFresh(long own)
        {
            lock (_gate)
            {
                return _known && own - _measuredAt <= MaxAge;
            }
        }

        /// <summary>Half-width of the interval that holds the true offset; -1 without one.</summary>
        public long Uncertainty(long own)
        {
            lock (_gate)
            {
                return _known ? HalfWidthAt(own) : -1;
            }
        }

        private long HalfWidthAt(long own)
        {
            return _halfWidth + (long)(Math.Abs(own - _at) * MaxDrift);
        }

        /// <summary>A service may answer with any 64 bits.</summary>
        private static double Distance(long a, long b)
        {
            return Math.Abs((double)a - b);
        }
    }
}
