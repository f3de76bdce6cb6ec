using System;

namespace Foottrack
{
    /// <summary>Values by byte strings, looked up in somebody else's buffer without a copy. It does not grow.</summary>
    internal sealed class ByteTable<T> where T : class
    {
        private readonly byte[][] _keys;
        private readonly T[] _values;
        private readonly int _most;
        private int _count;

        public ByteTable(int most)
        {
            int places = 4;
            while (places < 2 * most)
            {
                places *= 2;
            }
            _keys = new byte[places][];
            _values = new T[places];
            _most = most;
        }

        /// <summary>Null where there is none.</summary>
        public T Find(byte[] bytes, int offset, int length)
        {
            return _values[PlaceOf(bytes, offset, length)];
        }

        /// <summary>Takes a value under a key that has none; false when it is full.</summary>
        public bool TryAdd(byte[] bytes, int offset, int length, T value)
        {
            if (_count >= _most)
            {
                return false;
            }
            int place = PlaceOf(bytes, offset, length);
            _keys[place] = new byte[length];
            Array.Copy(bytes, offset, _keys[place], 0, length);
            _values[place] = value;
            _count++;
            return true;
        }

        public void Clear()
        {
            Array.Clear(_keys, 0, _keys.Length);
            Array.Clear(_values, 0, _values.Length);
            _count = 0;
        }

        private int PlaceOf(byte[] bytes, int offset, int length)
        {
            uint hash = 2166136261;
            for (int i = 0; i < length; i++)
            {
                hash = unchecked((hash ^ bytes[offset + i]) * 16777619);
            }
            int place = (int)(hash & (uint)(_keys.Length - 1));
            while (_keys[place] != null && !Utf8.AreEqual(_keys[place], bytes, offset, length))
            {
                place = (place + 1) & (_keys.Length - 1);
            }
            return place;
        }
    }

    /// <summary>Strings that come again and again, such as `src` and `sid`, without making them again.</summary>
    internal sealed class StringCache
    {
        private const int Most = 1024;
        private const int LongestKept = 256;

        private readonly ByteTable<string> _table = new ByteTable<string>(Most);

        public string Get(byte[] bytes, int offset, int length)
        {
            if (length > LongestKept)
            {
                return Utf8.Text(bytes, offset, length);
            }
            string found = _table.Find(bytes, offset, length);
            if (found == null)
            {
                found = Utf8.Text(bytes, offset, length);
                if (!_table.TryAdd(bytes, offset, length, found))
                {
                    _table.Clear();
                }
            }
            return found;
        }
    }
}
