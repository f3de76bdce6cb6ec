using UnityEngine;

namespace Foottrack
{
    /// <summary>A leg's bones, as they were when the avatar stood at rest.</summary>
    internal sealed class LegBones
    {
        public readonly Transform Upper, Lower, Foot;
        /// <summary>From the wire's foot frame (+Y up, +Z to the toes in Unity's axes) to the bone.</summary>
        public readonly Quaternion FootToBone;

        public LegBones(Transform upper, Transform lower, Transform foot, Transform root)
        {
            Upper = upper;
            Lower = lower;
            Foot = foot;
            FootToBone = Quaternion.Inverse(root.rotation) * foot.rotation;
        }
    }

    /// <summary>What an avatar at rest says of itself. Lengths are in the root's own scale.</summary>
    internal sealed class AvatarMeasures
    {
        public readonly LegBones Left, Right;
        public readonly float LegLength;
        /// <summary>Of the ankle joints above the root.</summary>
        public readonly float AnkleHeight;
        /// <summary>Middle of the hip joints.</summary>
        public readonly Vector3 Hips;

        private readonly Transform _root;

        /// <summary>Null where a bone is missing.</summary>
        public static AvatarMeasures Of(Transform root, LegBones left, LegBones right)
        {
            return left == null || right == null ? null : new AvatarMeasures(root, left, right);
        }

        /// <summary>Null where a bone is missing.</summary>
        public static LegBones Leg(Transform root, Transform upper, Transform lower, Transform foot)
        {
            return upper == null || lower == null || foot == null ? null : new LegBones(upper, lower, foot, root);
        }

        private AvatarMeasures(Transform root, LegBones left, LegBones right)
        {
            _root = root;
            Left = left;
            Right = right;
            LegLength = (Length(left) + Length(right)) / 2;
            AnkleHeight = (Local(left.Foot).y + Local(right.Foot).y) / 2;
            Hips = HipsNow();
        }

        /// <summary>Middle of the hip joints as the avatar is posed now, in the root's space.</summary>
        public Vector3 HipsNow()
        {
            return (Local(Left.Upper) + Local(Right.Upper)) / 2;
        }

        private float Length(LegBones leg)
        {
            Vector3 knee = Local(leg.Lower);
            return Vector3.Distance(Local(leg.Upper), knee) + Vector3.Distance(knee, Local(leg.Foot));
        }

        private Vector3 Local(Transform bone)
        {
            return _root.InverseTransformPoint(bone.position);
        }
    }
}
