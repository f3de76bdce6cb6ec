using NUnit.Framework;
using UnityEngine;

namespace Foottrack.Tests
{
    public sealed class BodyGoalsTests
    {
        private static readonly Quat Upright = new Quat(0.0, 0.0, 0.0, 1.0);

        [Test]
        public void AFootIsCarriedAlongByItsVelocity()
        {
            BodyGoals goals = InTheWorld();
            goals.Follow(new BodyPose { Left = Foot(0.0, -1.0) }, 0.05f, 1f);
            AssertAt(new Vector3(0f, 0.1f, 0.25f + 0.05f), goals.Left.Goal.Position);
        }

        [Test]
        public void ButNotFurtherThanAHundredMilliseconds()
        {
            BodyGoals goals = InTheWorld();
            goals.Follow(new BodyPose { Left = Foot(0.0, -1.0) }, 5f, 1f);
            AssertAt(new Vector3(0f, 0.1f, 0.25f + 0.1f), goals.Left.Goal.Position);
        }

        [Test]
        public void WhatIsLostFadesOutWhereItWas()
        {
            BodyGoals goals = InTheWorld();
            goals.Follow(new BodyPose { Left = Foot(0.0, 0.0), Right = Foot(0.3, 0.0) }, 0f, 1f);
            Assert.AreEqual(1.0, goals.Left.Weight, 1e-6);
            FootPose lost = Foot(9.0, 0.0).Value;
            lost.Stage = FootStage.Lost;
            goals.Follow(new BodyPose { Left = lost }, 0f, 0.1f);
            Assert.AreEqual(0.5, goals.Left.Weight, 1e-6);
            Assert.AreEqual(0.5, goals.Right.Weight, 1e-6);
            AssertAt(new Vector3(0f, 0.1f, 0.25f), goals.Left.Goal.Position);
            goals.Release(0.1f);
            Assert.AreEqual(0.0, goals.Left.Weight, 1e-6);
        }

        [Test]
        public void AStageThatIsTurnedAndMovedTurnsAndMovesTheFeet()
        {
            var goals = new BodyGoals();
            // A quarter turn to the right about +Y: Unity's forward (+Z) becomes +X.
            float half = Mathf.Sqrt(0.5f);
            goals.Frame(new Vector3(10f, 0f, 0f), new Quaternion(0f, half, 0f, half), 2f, 0.05f, Vector3.forward);
            goals.Follow(new BodyPose { Left = Foot(0.0, 0.0) }, 0f, 1f);
            AssertAt(new Vector3(10f + 0.5f, 0.3f, 0f), goals.Left.Goal.Position);
            AssertAt(new Vector3(1f, 0f, 0f), goals.Left.Goal.Rotation * Vector3.forward);
        }

        [Test]
        public void AKneeThatIsNotKnownPointsForward()
        {
            BodyGoals goals = InTheWorld();
            goals.Follow(new BodyPose { Left = Foot(0.0, 0.0) }, 0f, 1f);
            Vector3 way = goals.Left.Goal.Hint - goals.Left.Goal.Position;
            Assert.IsTrue(way.z > 0.1f && way.y > 0.1f);
            FootPose known = Foot(0.0, 0.0).Value;
            known.Knee = new Vec3(0.0, 0.5, -0.2);
            goals.Follow(new BodyPose { Left = known }, 0f, 1f);
            AssertAt(new Vector3(0f, 0.5f, 0.2f), goals.Left.Goal.Hint);
        }

        [Test]
        public void AWalkersHipsAreLowered()
        {
            BodyGoals goals = InTheWorld();
            var foot = new IkFoot { P = new Vec3(0.1, 0.09, 0.0), Q = Upright, Hint = new Vec3(0.1, 0.5, -1.0) };
            goals.Follow(
                new IkTargets { Left = foot, Right = foot, PelvisDy = -0.04 }, new Vector3(0f, 0.9f, 0f), 1f);
            AssertAt(new Vector3(0f, 0.86f, 0f), goals.Hips.Value);
            AssertAt(new Vector3(0.1f, 0.5f, 1f), goals.Right.Goal.Hint);
        }

        private static BodyGoals InTheWorld()
        {
            var goals = new BodyGoals();
            goals.Frame(Vector3.zero, Quaternion.identity, 1f, 0f, Vector3.forward);
            return goals;
        }

        /// <summary>0.25 m before the stage's origin.</summary>
        private static FootPose? Foot(double x, double vz)
        {
            return new FootPose
            {
                Ankle = new RigidPose(new Vec3(x, 0.1, -0.25), Upright),
                V = new Vec3(0.0, 0.0, vz),
                Stage = FootStage.Marker,
            };
        }

        private static void AssertAt(Vector3 expected, Vector3 found)
        {
            Assert.AreEqual(0.0, Vector3.Distance(expected, found), 1e-5);
        }
    }
}
