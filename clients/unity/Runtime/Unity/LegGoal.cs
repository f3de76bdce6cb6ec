using UnityEngine;

namespace Foottrack
{
    /// <summary>Where a foot should be, world space.</summary>
    internal struct LegGoal
    {
        public bool Known;
        /// <summary>The ankle joint.</summary>
        public Vector3 Position;
        /// <summary>Z to the toes, Y up: as Unity has the feet of its IK goals.</summary>
        public Quaternion Rotation;
        /// <summary>The knee is on this side.</summary>
        public Vector3 Hint;
    }

    /// <summary>
    /// How much of a goal counts: what is lost or silent fades out, and comes back the same way. The last goal that was
    /// known stays while it fades.
    /// </summary>
    internal sealed class FadingGoal
    {
        public const float ReleaseSeconds = 0.2f;

        private float _weight;

        public LegGoal Goal;

        public float Weight { get { return Mathf.SmoothStep(0f, 1f, _weight); } }

        public void Follow(LegGoal goal, float deltaSeconds)
        {
            if (goal.Known)
            {
                Goal = goal;
            }
            _weight = Mathf.MoveTowards(_weight, goal.Known ? 1f : 0f, deltaSeconds / ReleaseSeconds);
        }
    }
}
