namespace Foottrack
{
    /// <summary>
    /// Walks a payload once before anything is read from it: exactly one value, well formed, within the limits, its
    /// strings UTF-8. What it let pass can be read without further checks of bounds.
    /// </summary>
    internal sealed class MsgpackScanner
    {
        public const int MaxDepth = 12;
        public const int MaxItems = 1024;

        private byte[] _bytes;
        private int _at;
        private int _end;

        public Refusal Scan(byte[] bytes, int offset, int length)
        {
            _bytes = bytes;
            _at = offset;
            _end = offset + length;
            Refusal found = Value(0);
            return found == Refusal.None && _at != _end ? Refusal.Msgpack : found;
        }

        /// <summary>Where the value at `offset` ends, in a payload that was scanned.</summary>
        public int EndOf(int offset)
        {
            _at = offset;
            Value(0);
            return _at;
        }

        private Refusal Value(int depth)
        {
            if (_at >= _end)
            {
                return Refusal.Msgpack;
            }
            int code = _bytes[_at++];
            if (code < 0x80 || code >= 0xe0)
            {
                return Refusal.None;
            }
            if (code < 0xa0)
            {
                return Items(code & 0x0f, code < 0x90, depth);
            }
            if (code < 0xc0)
            {
                return Text(code & 0x1f);
            }
            switch (code)
            {
                case 0xc0: case 0xc2: case 0xc3: return Refusal.None;
                case 0xc4: return Bytes(Length(1));
                case 0xc5: return Bytes(Length(2));
                case 0xc6: return Bytes(Length(4));
                case 0xc7: return Extension(Length(1));
                case 0xc8: return Extension(Length(2));
                case 0xc9: return Extension(Length(4));
                case 0xca: case 0xce: case 0xd2: return Bytes(4);
                case 0xcb: case 0xcf: case 0xd3: return Bytes(8);
                case 0xcc: case 0xd0: return Bytes(1);
                case 0xcd: case 0xd1: return Bytes(2);
                case 0xd4: case 0xd5: case 0xd6: case 0xd7: case 0xd8: return Extension(1L << (code - 0xd4));
                case 0xd9: return Text(Length(1));
                case 0xda: return Text(Length(2));
                case 0xdb: return Text(Length(4));
                case 0xdc: return Items(Length(2), false, depth);
                case 0xdd: return Items(Length(4), false, depth);
                case 0xde: return Items(Length(2), true, depth);
                case 0xdf: return Items(Length(4), true, depth);
                default: return Refusal.Msgpack;
            }
        }

        private Refusal Items(long count, bool map, int depth)
        {
            if (depth >= MaxDepth)
            {
                return Refusal.Depth;
            }
            if (count < 0 || count > MaxItems)
            {
                return Refusal.Msgpack;
            }
            for (long i = 0; i < count; i++)
            {
                Refusal found = map ? Key() : Refusal.None;
                if (found == Refusal.None)
                {
                    found = Value(depth + 1);
                }
                if (found != Refusal.None)
                {
                    return found;
                }
            }
            return Refusal.None;
        }

        private Refusal Key()
        {
            if (_at >= _end)
            {
                return Refusal.Msgpack;
            }
            int code = _bytes[_at];
            bool isText = (code >= 0xa0 && code < 0xc0) || (code >= 0xd9 && code <= 0xdb);
            bool isBytes = code >= 0xc4 && code <= 0xc6;
            return isText || isBytes ? Value(0) : Refusal.Msgpack;
        }

        private Refusal Extension(long length)
        {
            return length < 0 ? Refusal.Msgpack : Bytes(length + 1);
        }

        private Refusal Bytes(long length)
        {
            if (length < 0 || length > _end - _at)
            {
                return Refusal.Msgpack;
            }
            _at += (int)length;
            return Refusal.None;
        }

        private Refusal Text(long length)
        {
            int from = _at;
            if (Bytes(length) != Refusal.None)
            {
                return Refusal.Msgpack;
            }
            return Utf8.IsValid(_bytes, from, (int)length) ? Refusal.None : Refusal.Msgpack;
        }

        /// <summary>-1 when the payload ends before it.</summary>
        private long Length(int width)
        {
            if (width > _end - _at)
            {
                return -1;
            }
            long value = 0;
            for (int i = 0; i < width; i++)
            {
                value = (value << 8) | _bytes[_at++];
            }
            return value;
        }
    }
}
