using System;

namespace Foottrack
{
    /// <summary>Writes msgpack into a buffer that is large enough, without allocating.</summary>
    internal sealed class MsgpackWriter
    {
        private byte[] _bytes;

        public int Position { get; private set; }

        public void Begin(byte[] bytes, int offset)
        {
            _bytes = bytes;
            Position = offset;
        }

        /// <summary>Up to 15 pairs.</summary>
        public void Map(int pairs)
        {
            Byte(0x80 | pairs);
        }

        public void Nil()
        {
            Byte(0xc0);
        }

        public void Bool(bool value)
        {
            Byte(value ? 0xc3 : 0xc2);
        }

        public void Int(long value)
        {
            if (value >= 0 && value < 0x80)
            {
                Byte((int)value);
                return;
            }
            Byte(0xd3);
            BigEndian(value);
        }

        public void Float(double value)
        {
            Byte(0xcb);
            BigEndian(BitConverter.DoubleToInt64Bits(value));
        }

        /// <summary>UTF-8, up to 255 bytes.</summary>
        public void Text(byte[] utf8)
        {
            if (utf8.Length < 32)
            {
                Byte(0xa0 | utf8.Length);
            }
            else
            {
                Byte(0xd9);
                Byte(utf8.Length);
            }
            Array.Copy(utf8, 0, _bytes, Position, utf8.Length);
            Position += utf8.Length;
        }

        public void Vec3(Vec3 v)
        {
            Byte(0x93);
            Float(v.X);
            Float(v.Y);
            Float(v.Z);
        }

        public void Quat(Quat q)
        {
            Byte(0x94);
            Float(q.X);
            Float(q.Y);
            Float(q.Z);
            Float(q.W);
        }

        private void BigEndian(long bits)
        {
            for (int shift = 56; shift >= 0; shift -= 8)
            {
                Byte((int)(bits >> shift) & 0xff);
            }
        }

        private void Byte(int value)
        {
            _bytes[Position++] = (byte)value;
        }
    }
}
