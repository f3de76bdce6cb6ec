namespace Foottrack
{
    /// <summary>Values that may be nil.</summary>
    internal static class Optional
    {
        public static Vec3? Vec3(MsgpackReader r)
        {
            return r.ReadNil() ? (Vec3?)null : r.ReadVec3();
        }

        public static Quat? Quat(MsgpackReader r)
        {
            return r.ReadNil() ? (Quat?)null : r.ReadQuat();
        }

        public static double? Float(MsgpackReader r)
        {
            return r.ReadNil() ? (double?)null : r.ReadFloat();
        }

        public static double? NotNegative(MsgpackReader r)
        {
            return r.ReadNil() ? (double?)null : r.ReadNotNegative();
        }

        public static long? Int(MsgpackReader r)
        {
            return r.ReadNil() ? (long?)null : r.ReadInt();
        }
    }
}
