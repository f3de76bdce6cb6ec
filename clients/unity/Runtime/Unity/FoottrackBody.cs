using System;
using UnityEngine;

namespace Foottrack
{
    /// <summary>Where an avatar's targets come from.</summary>
    public enum FollowMode
    {
        /// <summary>`pose/body`: the avatar's feet are where the user's feet are.</summary>
        Tracked,
        /// <summary>`pose/ik`: the avatar walks where the user walks in place.</summary>
        WalkInPlace,
    }

    /// <summary>A leg for Animation Rigging: what its TwoBoneIKConstraint has as target and hint, and its bones.</summary>
    [Serializable]
    public sealed class RigLeg
    {
        public Transform target;
        public Transform hint;
        [Tooltip("Only where there is no humanoid Animator.")]
        public Transform upperLeg;
        public Transform lowerLeg;
        public Transform foot;
    }

    /// <summary>
    /// Drives an avatar's legs: by the IK of a humanoid Animator (switch on "IK Pass" on its layer), or by Animation
    /// Rigging, whose targets and hints it then moves. What is not known is not made up: a foot that is lost, not
    /// valid or silent goes back to the animation.
    /// </summary>
    [DefaultExecutionOrder(-50)]
    [AddComponentMenu("Foottrack/Foottrack Body")]
    public sealed class FoottrackBody : MonoBehaviour
    {
        /// <summary>A pose that is older is no pose any more.</summary>
        public const float StaleSeconds = 0.5f;
        private const float ShortestLeg = 0.1f;
        private const float ScaleTolerance = 0.005f;

        public FoottrackClient client;
        [Tooltip("What the poses are in: the XR origin's camera offset; empty: the world.")]
        public Transform stage;
        public FollowMode follow = FollowMode.Tracked;
        [Tooltip("Move this object below the hips, or along the walk. Off when something else moves the avatar.")]
        public bool moveAvatar = true;
        [Tooltip("Scale this object so that the avatar's legs are as long as the user's.")]
        public bool scaleToUser = true;
        [Tooltip("The user's ankle joint above the sole, m, as the service is set up.")]
        public float ankleHeight = 0.09f;
        [Tooltip("The picture shows what will be so much later than Update, s.")]
        public float lead;
        [Tooltip("For Animation Rigging: is put between the hip joints.")]
        public Transform hipsTarget;
        public RigLeg leftRig = new RigLeg();
        public RigLeg rightRig = new RigLeg();

        private readonly BodyGoals _goals = new BodyGoals();
        private Animator _animator;
        private AvatarMeasures _avatar;
        private Vector3 _hips;
        private Vector3 _wanted;
        private Vector3 _shift;
        private Quaternion _lean = Quaternion.identity;
        private int _shiftedFrame = -1;
        private float _hipsWeight;

        private void Awake()
        {
            _animator = GetComponent<Animator>();
            bool humanoid = _animator != null && _animator.isHuman;
            _avatar = AvatarMeasures.Of(
                transform,
                humanoid
                    ? Leg(HumanBodyBones.LeftUpperLeg, HumanBodyBones.LeftLowerLeg, HumanBodyBones.LeftFoot)
                    : AvatarMeasures.Leg(transform, leftRig.upperLeg, leftRig.lowerLeg, leftRig.foot),
                humanoid
                    ? Leg(HumanBodyBones.RightUpperLeg, HumanBodyBones.RightLowerLeg, HumanBodyBones.RightFoot)
                    : AvatarMeasures.Leg(transform, rightRig.upperLeg, rightRig.lowerLeg, rightRig.foot));
            if (_avatar == null)
            {
                Debug.LogError("foottrack: a humanoid Animator is needed here, or the legs' bones", this);
                enabled = false;
                return;
            }
            _hips = _avatar.Hips;
        }

        private void Update()
        {
            if (client == null)
            {
                return;
            }
            Received<BodyPose> body;
            Received<IkTargets> targets;
            bool track = follow == FollowMode.Tracked;
            bool known = client.TryGetBodyPose(out body) && IsFresh(body);
            if (known && scaleToUser)
            {
                Scale(body.Body);
            }
            if (track && known)
            {
                Track(body);
            }
            else if (!track && client.TryGetIkTargets(out targets) && IsFresh(targets))
            {
                Walk(targets);
            }
            else
            {
                _goals.Release(Time.deltaTime);
            }
            Move(leftRig, _avatar.Left, _goals.Left);
            Move(rightRig, _avatar.Right, _goals.Right);
            if (hipsTarget != null && _goals.Hips.HasValue)
            {
                hipsTarget.position = _goals.Hips.Value;
                hipsTarget.rotation = _goals.HipsRotation;
            }
        }

        private void LateUpdate()
        {
            // How the animation alone would stand, to be shifted from in the next frame.
            _hips = _avatar.HipsNow() - _shift;
        }

        private void OnAnimatorIK(int layerIndex)
        {
            // Called for each layer that has an IK pass, and a shift must not be added twice.
            if (_shiftedFrame != Time.frameCount)
            {
                _shiftedFrame = Time.frameCount;
                ShiftHips();
            }
            Apply(AvatarIKGoal.LeftFoot, AvatarIKHint.LeftKnee, _goals.Left);
            Apply(AvatarIKGoal.RightFoot, AvatarIKHint.RightKnee, _goals.Right);
        }

        private void ShiftHips()
        {
            bool known = _goals.Hips.HasValue;
            _hipsWeight = Mathf.MoveTowards(_hipsWeight, known ? 1f : 0f, Time.deltaTime / FadingGoal.ReleaseSeconds);
            if (known)
            {
                _wanted = transform.InverseTransformPoint(_goals.Hips.Value) - _hips;
                _lean = _goals.HipsRotation * Quaternion.Inverse(transform.rotation);
            }
            _shift = _wanted * _hipsWeight;
            _animator.bodyPosition += transform.TransformVector(_shift);
            _animator.bodyRotation = Quaternion.Slerp(Quaternion.identity, _lean, _hipsWeight) * _animator.bodyRotation;
        }

        private LegBones Leg(HumanBodyBones upper, HumanBodyBones lower, HumanBodyBones foot)
        {
            return AvatarMeasures.Leg(
                transform,
                _animator.GetBoneTransform(upper),
                _animator.GetBoneTransform(lower),
                _animator.GetBoneTransform(foot));
        }

        private bool IsFresh<T>(Received<T> message)
        {
            return message.Envelope.Valid && client.Age(message) < StaleSeconds;
        }

        private void Track(Received<BodyPose> message)
        {
            _goals.Frame(StageOrigin, StageAxes, StageSize, Lift(StageSize), transform.forward);
            _goals.Follow(message.Body, client.Age(message) + lead, Time.deltaTime);
            if (moveAvatar && _goals.Hips.HasValue)
            {
                Vector3 hips = Quaternion.Inverse(StageAxes) * (_goals.Hips.Value - StageOrigin);
                transform.position = StageOrigin + StageAxes * new Vector3(hips.x, 0f, hips.z);
                Face(_goals.HipsRotation * Vector3.forward);
            }
        }

        private void Walk(Received<IkTargets> message)
        {
            IkTargets targets = message.Body;
            Vector3 heading = StageAxes * UnityAxes.ToUnity(targets.Heading);
            if (moveAvatar)
            {
                transform.position += heading * ((float)targets.Speed * StageSize * Time.deltaTime);
                Face(heading);
            }
            _goals.Frame(transform.position, transform.rotation, StageSize, Lift(StageSize), transform.forward);
            _goals.Follow(targets, _avatar.Hips * (transform.lossyScale.y / StageSize), Time.deltaTime);
        }

        /// <summary>The user's bones do not stretch: their length is that of the legs in any message.</summary>
        private void Scale(BodyPose body)
        {
            if (!IsLeg(body.Left) || !IsLeg(body.Right))
            {
                return;
            }
            float length = (LengthOf(body.Left.Value) + LengthOf(body.Right.Value)) / 2 * StageSize;
            float factor = length / (_avatar.LegLength * transform.lossyScale.y);
            if (length > ShortestLeg && Mathf.Abs(factor - 1f) > ScaleTolerance)
            {
                transform.localScale *= factor;
            }
        }

        private static bool IsLeg(FootPose? foot)
        {
            return foot.HasValue && foot.Value.Hip.HasValue && foot.Value.Knee.HasValue;
        }

        private static float LengthOf(FootPose foot)
        {
            Vector3 knee = UnityAxes.ToUnity(foot.Knee.Value);
            return Vector3.Distance(UnityAxes.ToUnity(foot.Hip.Value), knee)
                + Vector3.Distance(knee, UnityAxes.ToUnity(foot.Ankle.P));
        }

        private void Face(Vector3 forward)
        {
            Vector3 up = StageAxes * Vector3.up;
            Vector3 flat = forward - up * Vector3.Dot(forward, up);
            if (flat.sqrMagnitude > 1e-6f)
            {
                transform.rotation = Quaternion.LookRotation(flat, up);
            }
        }

        private void Apply(AvatarIKGoal foot, AvatarIKHint knee, FadingGoal fading)
        {
            _animator.SetIKPositionWeight(foot, fading.Weight);
            _animator.SetIKRotationWeight(foot, fading.Weight);
            _animator.SetIKHintPositionWeight(knee, fading.Weight);
            if (fading.Weight > 0f)
            {
                _animator.SetIKPosition(foot, fading.Goal.Position);
                _animator.SetIKRotation(foot, fading.Goal.Rotation);
                _animator.SetIKHintPosition(knee, fading.Goal.Hint);
            }
        }

        /// <summary>Targets turn the bone itself; how it stands in the foot is known from the pose at rest.</summary>
        private static void Move(RigLeg rig, LegBones bones, FadingGoal fading)
        {
            if (rig.target == null || fading.Weight <= 0f)
            {
                return;
            }
            Quaternion bone = fading.Goal.Rotation * bones.FootToBone;
            rig.target.position = Vector3.Lerp(rig.target.position, fading.Goal.Position, fading.Weight);
            rig.target.rotation = Quaternion.Slerp(rig.target.rotation, bone, fading.Weight);
            if (rig.hint != null)
            {
                rig.hint.position = fading.Goal.Hint;
            }
        }

        private float Lift(float size)
        {
            return _avatar.AnkleHeight * transform.lossyScale.y / size - ankleHeight;
        }

        private Vector3 StageOrigin { get { return stage != null ? stage.position : Vector3.zero; } }

        private Quaternion StageAxes { get { return stage != null ? stage.rotation : Quaternion.identity; } }

        private float StageSize { get { return stage != null ? stage.lossyScale.y : 1f; } }
    }
}
