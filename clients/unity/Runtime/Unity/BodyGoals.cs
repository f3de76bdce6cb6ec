using UnityEngine;

namespace Foottrack
{
    /// <summary>Messages to goals for an avatar, in Unity's axes and world space.</summary>
    internal sealed class BodyGoals
    {
        /// <summary>Feet are not carried further than this by their published velocity.</summary>
        public const float MaxExtrapolationSeconds = 0.1f;
        private const float KneeHintDistance = 0.5f;

        public readonly FadingGoal Left = new FadingGoal(), Right = new FadingGoal();

        /// <summary>Middle of the hip joints, world, and the hips' rotation; where the message knows them.</summary>
        public Vector3? Hips;
        public Quaternion HipsRotation = Quaternion.identity;

        private Vector3 _origin;
        private Quaternion _axes;
        private float _size;
        private Vector3 _lift;
        private Vector3 _forward;

        /// <summary>
        /// What the goals are in, before each message: stage or avatar in the world; `lift` makes up for ankles that
        /// are higher above the sole than the user's, m; `forward` is where knees point when nothing else is known.
        /// </summary>
        public void Frame(Vector3 origin, Quaternion axes, float size, float lift, Vector3 forward)
        {
            _origin = origin;
            _axes = axes;
            _size = size;
            _lift = new Vector3(0f, lift, 0f);
            _forward = forward;
        }

        /// <summary>`ahead`: from the message's instant to the picture's, s.</summary>
        public void Follow(BodyPose body, float ahead, float deltaSeconds)
        {
            Hips = body.Hips.HasValue ? Place(UnityAxes.ToUnity(body.Hips.Value.P) + _lift) : (Vector3?)null;
            if (body.Hips.HasValue)
            {
                HipsRotation = _axes * UnityAxes.ToUnity(body.Hips.Value.Q);
            }
            ahead = Mathf.Clamp(ahead, 0f, MaxExtrapolationSeconds);
            Left.Follow(Goal(body.Left, ahead), deltaSeconds);
            Right.Follow(Goal(body.Right, ahead), deltaSeconds);
        }

        /// <summary>`standingHips` is their height at rest, in the avatar's frame.</summary>
        public void Follow(IkTargets targets, Vector3 standingHips, float deltaSeconds)
        {
            Hips = Place(standingHips + new Vector3(0f, (float)targets.PelvisDy, 0f));
            HipsRotation = _axes;
            Left.Follow(Goal(targets.Left), deltaSeconds);
            Right.Follow(Goal(targets.Right), deltaSeconds);
        }

        /// <summary>No message that may be shown.</summary>
        public void Release(float deltaSeconds)
        {
            Hips = null;
            Left.Follow(new LegGoal(), deltaSeconds);
            Right.Follow(new LegGoal(), deltaSeconds);
        }

        private LegGoal Goal(FootPose? foot, float ahead)
        {
            if (!foot.HasValue || foot.Value.Stage == FootStage.Lost)
            {
                return new LegGoal();
            }
            FootPose known = foot.Value;
            Vector3 moved = UnityAxes.ToUnity(known.V) * ahead;
            Vector3 ankle = Place(UnityAxes.ToUnity(known.Ankle.P) + moved + _lift);
            return new LegGoal
            {
                Known = true,
                Position = ankle,
                Rotation = _axes * UnityAxes.ToUnity(known.Ankle.Q),
                Hint = known.Knee.HasValue
                    ? Place(UnityAxes.ToUnity(known.Knee.Value) + moved * 0.5f + _lift)
                    : ankle + (_forward + Vector3.up) * KneeHintDistance,
            };
        }

        private LegGoal Goal(IkFoot foot)
        {
            return new LegGoal
            {
                Known = true,
                Position = Place(UnityAxes.ToUnity(foot.P) + _lift),
                Rotation = _axes * UnityAxes.ToUnity(foot.Q),
                Hint = Place(UnityAxes.ToUnity(foot.Hint) + _lift),
            };
        }

        private Vector3 Place(Vector3 local)
        {
            return _origin + _axes * (local * _size);
        }
    }
}
