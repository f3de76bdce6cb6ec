using System.Runtime.InteropServices;

namespace Foottrack
{
    /// <summary>What BitConverter has for doubles only, in netstandard 2.0.</summary>
    [StructLayout(LayoutKind.Explicit)]
    internal struct SingleBits
    {
        [FieldOffset(0)] private int _bits;
        [FieldOffset(0)] private float _value;

        public static float ToSingle(int bits)
        {
            var both = new SingleBits();
            both._bits = bits;
            return both._value;
        }
    }
}
