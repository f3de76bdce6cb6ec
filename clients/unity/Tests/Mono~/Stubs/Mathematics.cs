using System;

namespace UnityEngine
{
    // What the thin layer uses of Unity's mathematics, so that it runs under mono. Unity's own source is not public;
    // the conventions are those of its manual: left-handed, +Z forward, v' = q v q*.
    public struct Vector3
    {
        public float x, y, z;

        public Vector3(float x, float y, float z)
        {
            this.x = x;
            this.y = y;
            this.z = z;
        }

        public static Vector3 zero { get { return new Vector3(); } }
        public static Vector3 one { get { return new Vector3(1f, 1f, 1f); } }
        public static Vector3 up { get { return new Vector3(0f, 1f, 0f); } }
        public static Vector3 forward { get { return new Vector3(0f, 0f, 1f); } }
        public float sqrMagnitude { get { return Dot(this, this); } }

        public static float Dot(Vector3 a, Vector3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
        public static float Distance(Vector3 a, Vector3 b) { return Mathf.Sqrt((a - b).sqrMagnitude); }
        public static Vector3 Lerp(Vector3 a, Vector3 b, float t) { return a + (b - a) * t; }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
        public static Vector3 operator *(Vector3 v, float f) { return new Vector3(v.x * f, v.y * f, v.z * f); }
        public static Vector3 operator /(Vector3 v, float f) { return v * (1f / f); }

        public static Vector3 Cross(Vector3 a, Vector3 b)
        {
            return new Vector3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
        }
    }

    public struct Quaternion
    {
        public float x, y, z, w;

        public Quaternion(float x, float y, float z, float w)
        {
            this.x = x;
            this.y = y;
            this.z = z;
            this.w = w;
        }

        public static Quaternion identity { get { return new Quaternion(0f, 0f, 0f, 1f); } }

        public static Quaternion Inverse(Quaternion q) { return new Quaternion(-q.x, -q.y, -q.z, q.w); }

        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            return new Quaternion(
                a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
                a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
                a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        }

        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            var u = new Vector3(q.x, q.y, q.z);
            Vector3 across = Vector3.Cross(u, v);
            return v + across * (2f * q.w) + Vector3.Cross(u, across) * 2f;
        }

        /// <summary>Normalised linear interpolation: the ends are what the tests look at.</summary>
        public static Quaternion Slerp(Quaternion a, Quaternion b, float t)
        {
            float sign = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w < 0f ? -1f : 1f;
            var q = new Quaternion(
                a.x + (sign * b.x - a.x) * t,
                a.y + (sign * b.y - a.y) * t,
                a.z + (sign * b.z - a.z) * t,
                a.w + (sign * b.w - a.w) * t);
            float n = Mathf.Sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
            return new Quaternion(q.x / n, q.y / n, q.z / n, q.w / n);
        }

        /// <summary>For directions that are level, about the vertical, which is all that is asked of it here.</summary>
        public static Quaternion LookRotation(Vector3 forward, Vector3 up)
        {
            if (up.y < 0.999f || Math.Abs(forward.y) > 1e-3f)
            {
                throw new NotSupportedException("the stub only turns about +Y");
            }
            float half = (float)Math.Atan2(forward.x, forward.z) / 2f;
            return new Quaternion(0f, (float)Math.Sin(half), 0f, (float)Math.Cos(half));
        }
    }

    public static class Mathf
    {
        public static float Sqrt(float f) { return (float)Math.Sqrt(f); }
        public static float Abs(float f) { return Math.Abs(f); }
        public static float Clamp(float f, float least, float most) { return Math.Min(Math.Max(f, least), most); }

        public static float MoveTowards(float from, float to, float step)
        {
            return Math.Abs(to - from) <= step ? to : from + Math.Sign(to - from) * step;
        }

        public static float SmoothStep(float from, float to, float t)
        {
            t = Clamp(t, 0f, 1f);
            return from + (to - from) * t * t * (3f - 2f * t);
        }
    }
}
