using System.Text;

namespace Foottrack
{
    /// <summary>UTF-8 as RFC 3629 has it: no overlong forms, no surrogates, nothing beyond U+10FFFF.</summary>
    internal static class Utf8
    {
        public static byte[] Bytes(string text)
        {
            return Encoding.UTF8.GetBytes(text);
        }

        public static string Text(byte[] bytes, int offset, int length)
        {
            return Encoding.UTF8.GetString(bytes, offset, length);
        }

        public static bool AreEqual(byte[] expected, byte[] bytes, int offset, int length)
        {
            if (length != expected.Length)
            {
                return false;
            }
            for (int i = 0; i < length; i++)
            {
                if (bytes[offset + i] != expected[i])
                {
                    return false;
                }
            }
            return true;
        }

        public static bool IsValid(byte[] bytes, int offset, int length)
        {
            int end = offset + length;
            while (offset < end)
            {
                int lead = bytes[offset++];
                if (lead < 0x80)
                {
                    continue;
                }
                int more = lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
                if (lead < 0xc2 || lead > 0xf4 || more > end - offset)
                {
                    return false;
                }
                int second = bytes[offset];
                int least = lead == 0xe0 ? 0xa0 : lead == 0xf0 ? 0x90 : 0x80;
                int most = lead == 0xed ? 0x9f : lead == 0xf4 ? 0x8f : 0xbf;
                if (second < least || second > most)
                {
                    return false;
                }
                for (int i = 1; i < more; i++)
                {
                    if ((bytes[offset + i] & 0xc0) != 0x80)
                    {
                        return false;
                    }
                }
                offset += more;
            }
            return true;
        }
    }
}
