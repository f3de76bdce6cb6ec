using System;

namespace Foottrack
{
    /// <summary>Vectors and rotations out of arrays of numbers.</summary>
    internal static class GeometryReader
    {
        /// <summary>Of a quaternion's or a direction's length.</summary>
        public const double UnitTolerance = 1e-3;

        public static Vec3 ReadVec3(this MsgpackReader r)
        {
            r.Require(r.EnterArray() == 3);
            return new Vec3(r.ReadFloat(), r.ReadFloat(), r.ReadFloat());
        }

        /// <summary>Normalised.</summary>
        public static Vec3 ReadDirection(this MsgpackReader r)
        {
            Vec3 v = r.ReadVec3();
            double scale = UnitScale(r, Math.Sqrt(v.X * v.X + v.Y * v.Y + v.Z * v.Z));
            return new Vec3(v.X * scale, v.Y * scale, v.Z * scale);
        }

        /// <summary>Normalised.</summary>
        public static Quat ReadQuat(this MsgpackReader r)
        {
            r.Require(r.EnterArray() == 4);
            var q = new Quat(r.ReadFloat(), r.ReadFloat(), r.ReadFloat(), r.ReadFloat());
            double scale = UnitScale(r, Math.Sqrt(q.X * q.X + q.Y * q.Y + q.Z * q.Z + q.W * q.W));
            return new Quat(q.X * scale, q.Y * scale, q.Z * scale, q.W * scale);
        }

        private static double UnitScale(MsgpackReader r, double length)
        {
            r.Require(Math.Abs(length - 1.0) <= UnitTolerance);
            return r.Fault == Refusal.None ? 1.0 / length : 0.0;
        }
    }
}
