using UnityEngine;

namespace Foottrack
{
    /// <summary>
    /// Between the wire's axes (right-handed, -Z forward) and Unity's (left-handed, +Z forward): the one place where z
    /// is mirrored (SPEC, section 4). Metres are metres.
    /// </summary>
    public static class UnityAxes
    {
        public static Vector3 ToUnity(Vec3 v)
        {
            return new Vector3((float)v.X, (float)v.Y, (float)-v.Z);
        }

        public static Quaternion ToUnity(Quat q)
        {
            return new Quaternion((float)-q.X, (float)-q.Y, (float)q.Z, (float)q.W);
        }

        public static Vec3 FromUnity(Vector3 v)
        {
            return new Vec3(v.x, v.y, -v.z);
        }

        public static Quat FromUnity(Quaternion q)
        {
            return new Quat(-q.x, -q.y, q.z, q.w);
        }
    }
}
