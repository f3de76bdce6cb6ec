using System.Collections.Generic;

namespace UnityEngine
{
    public enum HumanBodyBones
    {
        LeftUpperLeg,
        RightUpperLeg,
        LeftLowerLeg,
        RightLowerLeg,
        LeftFoot,
        RightFoot,
    }

    public enum AvatarIKGoal
    {
        LeftFoot,
        RightFoot,
    }

    public enum AvatarIKHint
    {
        LeftKnee,
        RightKnee,
    }

    /// <summary>
    /// A humanoid that stands still, animated by nothing: keeps what it is told, and moves its hip joints with the
    /// body, as far as that can be told without the engine.
    /// </summary>
    public sealed class Animator : Behaviour
    {
        public struct Goal
        {
            public Vector3 Position, Hint;
            public Quaternion Rotation;
            public float PositionWeight, RotationWeight, HintWeight;
        }

        public readonly Goal[] Goals = new Goal[2];
        public readonly Dictionary<HumanBodyBones, Transform> Bones = new Dictionary<HumanBodyBones, Transform>();
        private readonly Dictionary<Transform, Vector3> _rest = new Dictionary<Transform, Vector3>();
        private Vector3 _bodyAtRest;

        public bool isHuman { get { return true; } }
        public Vector3 bodyPosition { get; set; }
        public Quaternion bodyRotation { get; set; }

        public Transform GetBoneTransform(HumanBodyBones bone)
        {
            Transform found;
            return Bones.TryGetValue(bone, out found) ? found : null;
        }

        public void AddBone(HumanBodyBones bone, Vector3 local)
        {
            Transform made = new GameObject(bone.ToString()).transform;
            made.parent = transform;
            made.position = transform.TransformPoint(local);
            Bones[bone] = made;
            _rest[made] = local;
        }

        public void SetIKPosition(AvatarIKGoal goal, Vector3 p) { Goals[(int)goal].Position = p; }
        public void SetIKRotation(AvatarIKGoal goal, Quaternion q) { Goals[(int)goal].Rotation = q; }
        public void SetIKPositionWeight(AvatarIKGoal goal, float w) { Goals[(int)goal].PositionWeight = w; }
        public void SetIKRotationWeight(AvatarIKGoal goal, float w) { Goals[(int)goal].RotationWeight = w; }
        public void SetIKHintPosition(AvatarIKHint hint, Vector3 p) { Goals[(int)hint].Hint = p; }
        public void SetIKHintPositionWeight(AvatarIKHint hint, float w) { Goals[(int)hint].HintWeight = w; }

        internal void Animate()
        {
            _bodyAtRest = transform.TransformPoint(Vector3.up);
            bodyPosition = _bodyAtRest;
            bodyRotation = transform.rotation;
        }

        internal void Solve()
        {
            foreach (KeyValuePair<Transform, Vector3> bone in _rest)
            {
                bone.Key.position = transform.TransformPoint(bone.Value) + bodyPosition - _bodyAtRest;
            }
        }
    }
}
