using System;

namespace Foottrack
{
    /// <summary>
    /// Reads values of a payload that the scanner let pass, without allocating. The first fault sticks: every read
    /// after it gives zeros, so that whoever reads only looks at <see cref="Fault"/> in the end.
    /// </summary>
    internal sealed class MsgpackReader
    {
        private readonly MsgpackScanner _scanner = new MsgpackScanner();
        private byte[] _bytes;
        private int _at;
        private int _keyFrom;
        private int _keyLength;

        public Refusal Fault { get; private set; }

        /// <summary>What a value of a wrong type is.</summary>
        public Refusal Mistake { get; set; }

        /// <summary>Offset of the next value; to come back to it.</summary>
        public int Position
        {
            get { return _at; }
            set { _at = value; }
        }

        /// <summary>What the next value begins with; nil's after a fault.</summary>
        public int Code { get { return Fault == Refusal.None ? _bytes[_at] : 0xc0; } }

        /// <summary>Scans the payload and goes to its value.</summary>
        public void Load(byte[] bytes, int offset, int length)
        {
            _bytes = bytes;
            _at = offset;
            Mistake = Refusal.Body;
            Fault = _scanner.Scan(bytes, offset, length);
        }

        public void Refuse(Refusal reason)
        {
            if (Fault == Refusal.None)
            {
                Fault = reason;
            }
        }

        public void Require(bool condition)
        {
            if (!condition)
            {
                Refuse(Mistake);
            }
        }

        /// <summary>Number of pairs of the map that is due here.</summary>
        public int EnterMap()
        {
            return Enter(0x80, 0xde);
        }

        /// <summary>Number of elements of the array that is due here.</summary>
        public int EnterArray()
        {
            return Enter(0x90, 0xdc);
        }

        /// <summary>Goes to a pair's value; <see cref="KeyIs"/> and <see cref="KeyText"/> then tell the key.</summary>
        public void ReadKey()
        {
            if (Fault != Refusal.None)
            {
                return;
            }
            bool isText = IsText();
            _keyLength = Span(out _keyFrom);
            _at = _keyFrom + _keyLength;
            if (!isText)
            {
                _keyLength = -1;
            }
        }

        public bool KeyIs(byte[] name)
        {
            return Fault == Refusal.None && Utf8.AreEqual(name, _bytes, _keyFrom, _keyLength);
        }

        /// <summary>The key of a map whose keys are names; one that is bytes is a mistake.</summary>
        public string KeyText()
        {
            Require(_keyLength >= 0);
            return Fault == Refusal.None ? Utf8.Text(_bytes, _keyFrom, _keyLength) : "";
        }

        public void Skip()
        {
            if (Fault == Refusal.None)
            {
                _at = _scanner.EndOf(_at);
            }
        }

        /// <summary>Whether nil is here; goes past it.</summary>
        public bool ReadNil()
        {
            if (Fault != Refusal.None || _bytes[_at] != 0xc0)
            {
                return false;
            }
            _at++;
            return true;
        }

        public bool ReadBool()
        {
            if (Fault != Refusal.None)
            {
                return false;
            }
            int code = _bytes[_at];
            Require(code == 0xc2 || code == 0xc3);
            _at++;
            return code == 0xc3;
        }

        public long ReadInt()
        {
            bool fits;
            long value;
            if (Fault != Refusal.None)
            {
                return 0;
            }
            if (TryInteger(out value, out fits))
            {
                Require(fits);
                return value;
            }
            double number;
            bool notFinite = TryFloat(out number) && (double.IsNaN(number) || double.IsInfinity(number));
            Refuse(notFinite && Mistake == Refusal.Body ? Refusal.NotFinite : Mistake);
            return 0;
        }

        public long ReadCount()
        {
            long value = ReadInt();
            Require(value >= 0);
            return value;
        }

        /// <summary>Any integer; one beyond 63 bits is the largest.</summary>
        public long ReadAnyInt()
        {
            bool fits;
            long value;
            if (Fault != Refusal.None)
            {
                return 0;
            }
            Require(TryInteger(out value, out fits));
            return fits ? value : long.MaxValue;
        }

        public double ReadFloat()
        {
            bool fits;
            long whole;
            double value;
            if (Fault != Refusal.None)
            {
                return 0.0;
            }
            if (TryInteger(out whole, out fits))
            {
                return fits ? whole : (double)(ulong)whole;
            }
            if (!TryFloat(out value))
            {
                Refuse(Mistake);
            }
            else if (double.IsNaN(value) || double.IsInfinity(value))
            {
                Refuse(Refusal.NotFinite);
            }
            return value;
        }

        public double ReadNotNegative()
        {
            double value = ReadFloat();
            Require(value >= 0.0);
            return value;
        }

        /// <summary>Index of the string that is here among `names`.</summary>
        public int ReadName(byte[][] names)
        {
            int from, length = TextSpan(out from);
            for (int i = 0; length >= 0 && i < names.Length; i++)
            {
                if (Utf8.AreEqual(names[i], _bytes, from, length))
                {
                    return i;
                }
            }
            Refuse(Mistake);
            return 0;
        }

        public string ReadText()
        {
            int from, length = TextSpan(out from);
            return length >= 0 ? Utf8.Text(_bytes, from, length) : "";
        }

        /// <summary>A string that is likely to be in the cache.</summary>
        public string ReadText(StringCache cache)
        {
            int from, length = TextSpan(out from);
            return length >= 0 ? cache.Get(_bytes, from, length) : "";
        }

        public byte[] ReadBytes()
        {
            if (Fault != Refusal.None)
            {
                return null;
            }
            int code = _bytes[_at];
            Require(code >= 0xc4 && code <= 0xc6);
            if (Fault != Refusal.None)
            {
                return null;
            }
            int from, length = Span(out from);
            var copy = new byte[length];
            Array.Copy(_bytes, from, copy, 0, length);
            _at = from + length;
            return copy;
        }

        private int Enter(int fix, int wide)
        {
            if (Fault != Refusal.None)
            {
                return 0;
            }
            int code = _bytes[_at++];
            if ((code & 0xf0) == fix)
            {
                return code & 0x0f;
            }
            if (code == wide || code == wide + 1)
            {
                return (int)Unsigned(code == wide ? 2 : 4);
            }
            Refuse(Mistake);
            return 0;
        }

        private bool IsText()
        {
            int code = _bytes[_at];
            return (code >= 0xa0 && code < 0xc0) || (code >= 0xd9 && code <= 0xdb);
        }

        /// <summary>-1 and a fault where no string is; otherwise goes past it.</summary>
        private int TextSpan(out int from)
        {
            from = 0;
            Require(Fault != Refusal.None || IsText());
            if (Fault != Refusal.None)
            {
                return -1;
            }
            int length = Span(out from);
            _at = from + length;
            return length;
        }

        /// <summary>Content of the string or bytes that is here.</summary>
        private int Span(out int from)
        {
            int code = _bytes[_at++];
            int length = code < 0xc0 ? code & 0x1f : (int)Unsigned(1 << (code < 0xd9 ? code - 0xc4 : code - 0xd9));
            from = _at;
            return length;
        }

        /// <summary>Goes past an integer. One beyond 63 bits does not fit; its bits are returned.</summary>
        private bool TryInteger(out long value, out bool fits)
        {
            int code = _bytes[_at];
            fits = true;
            value = (sbyte)code;
            if (code < 0x80 || code >= 0xe0)
            {
                _at++;
                return true;
            }
            if (code < 0xcc || code > 0xd3)
            {
                return false;
            }
            _at++;
            int width = 1 << ((code - 0xcc) & 3);
            value = Unsigned(width);
            if (code >= 0xd0)
            {
                int unused = 64 - 8 * width;
                value = value << unused >> unused;
            }
            fits = code != 0xcf || value >= 0;
            return true;
        }

        private bool TryFloat(out double value)
        {
            int code = _bytes[_at];
            value = 0.0;
            if (code == 0xcb)
            {
                _at++;
                value = BitConverter.Int64BitsToDouble(Unsigned(8));
            }
            else if (code == 0xca)
            {
                _at++;
                value = SingleBits.ToSingle((int)Unsigned(4));
            }
            return code == 0xcb || code == 0xca;
        }

        private long Unsigned(int width)
        {
            long value = 0;
            for (int i = 0; i < width; i++)
            {
                value = (value << 8) | _bytes[_at++];
            }
            return value;
        }
    }
}
