using System;

namespace Foottrack
{
    /// <summary>
    /// The frames of one message, in a buffer that is used again. Only the first frames are kept, and none that is
    /// larger than a message of ours may be: of the others, only the length is known.
    /// </summary>
    internal sealed class FrameBuffer
    {
        private const int Kept = 3;
        private const int FirstSize = 4096;

        private readonly int[] _offsets = new int[Kept];
        private readonly int[] _lengths = new int[Kept];
        private int _used;

        public byte[] Bytes { get; private set; }

        /// <summary>All frames, also those that were not kept.</summary>
        public int Count { get; private set; }

        public FrameBuffer()
        {
            Bytes = new byte[FirstSize];
        }

        public int Offset(int frame)
        {
            return _offsets[frame];
        }

        public int Length(int frame)
        {
            return _lengths[frame];
        }

        public bool FrameIs(int frame, byte[] content)
        {
            return frame < Math.Min(Count, Kept) && _lengths[frame] <= MessageDecoder.MaxPayloadBytes
                && Utf8.AreEqual(content, Bytes, _offsets[frame], _lengths[frame]);
        }

        public bool FrameStartsWith(int frame, byte[] content)
        {
            return frame < Math.Min(Count, Kept) && _lengths[frame] >= content.Length
                && _lengths[frame] <= MessageDecoder.MaxPayloadBytes
                && Utf8.AreEqual(content, Bytes, _offsets[frame], content.Length);
        }

        public void Clear()
        {
            Count = 0;
            _used = 0;
        }

        /// <summary>Takes note of a frame and says where its content goes; -1: nowhere.</summary>
        public int Add(int length)
        {
            int frame = Count++;
            if (frame >= Kept)
            {
                return -1;
            }
            _offsets[frame] = _used;
            _lengths[frame] = length;
            if (length > MessageDecoder.MaxPayloadBytes)
            {
                return -1;
            }
            if (_used + length > Bytes.Length)
            {
                var larger = new byte[Math.Max(2 * Bytes.Length, _used + length)];
                Array.Copy(Bytes, larger, _used);
                Bytes = larger;
            }
            _used += length;
            return _offsets[frame];
        }
    }
}
