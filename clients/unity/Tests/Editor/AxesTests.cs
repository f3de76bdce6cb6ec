using NUnit.Framework;
using UnityEngine;

namespace Foottrack.Tests
{
    public sealed class AxesTests
    {
        [Test]
        public void ForwardOnTheWireIsForwardInUnity()
        {
            Vector3 v = UnityAxes.ToUnity(new Vec3(1.0, 2.0, -3.0));
            Assert.AreEqual(1f, v.x);
            Assert.AreEqual(2f, v.y);
            Assert.AreEqual(3f, v.z);
        }

        [Test]
        public void TurningThenMirroringIsMirroringThenTurning()
        {
            // 90 degrees about +X (0.7071), then a part of a turn about the others, unit length.
            var q = new Quat(0.5, -0.1, 0.7, 0.5);
            var v = new Vec3(0.3, -1.2, 0.8);
            Vector3 expected = UnityAxes.ToUnity(Turn(q, v));
            Vector3 found = UnityAxes.ToUnity(q) * UnityAxes.ToUnity(v);
            Assert.AreEqual(0.0, Vector3.Distance(expected, found), 1e-6);
        }

        [Test]
        public void YawToTheLeftIsToTheLeft()
        {
            // The wire's yaw is positive to the left: -Z turned by 90 degrees is -X.
            Vector3 ahead = UnityAxes.ToUnity(new Quat(0.0, System.Math.Sqrt(0.5), 0.0, System.Math.Sqrt(0.5)))
                * Vector3.forward;
            Assert.AreEqual(-1.0, ahead.x, 1e-6);
            Assert.AreEqual(0.0, ahead.z, 1e-6);
        }

        [Test]
        public void ThereAndBack()
        {
            var q = new Quat(0.5, -0.1, 0.7, 0.5);
            Quat back = UnityAxes.FromUnity(UnityAxes.ToUnity(q));
            Assert.AreEqual(q.X, back.X, 1e-7);
            Assert.AreEqual(q.Y, back.Y, 1e-7);
            Assert.AreEqual(q.Z, back.Z, 1e-7);
            Assert.AreEqual(q.W, back.W, 1e-7);
            Assert.AreEqual(-4.0, UnityAxes.FromUnity(UnityAxes.ToUnity(new Vec3(0.0, 0.0, -4.0))).Z);
        }

        /// <summary>As SPEC has it: v + 2 w (u x v) + 2 u x (u x v).</summary>
        private static Vec3 Turn(Quat q, Vec3 v)
        {
            Vec3 c = Cross(q, v), d = Cross(q, c);
            return new Vec3(
                v.X + 2 * (q.W * c.X + d.X), v.Y + 2 * (q.W * c.Y + d.Y), v.Z + 2 * (q.W * c.Z + d.Z));
        }

        private static Vec3 Cross(Quat u, Vec3 v)
        {
            return new Vec3(u.Y * v.Z - u.Z * v.Y, u.Z * v.X - u.X * v.Z, u.X * v.Y - u.Y * v.X);
        }
    }
}
