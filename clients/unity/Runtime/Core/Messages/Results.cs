namespace Foottrack
{
    /// <summary>What the estimate of a foot rests on.</summary>
    public enum FootStage
    {
        Marker,
        Depth,
        Inertial,
        Coasting,
        /// <summary>Do not draw it as if it were known.</summary>
        Lost,
    }

    /// <summary>One leg at the message's instant, stage frame.</summary>
    public struct FootPose
    {
        /// <summary>Joint, m; null without a headset.</summary>
        public Vec3? Hip, Knee;
        /// <summary>Ankle joint, foot to stage.</summary>
        public RigidPose Ankle;
        /// <summary>The toes' tip, m.</summary>
        public Vec3 Toe;
        /// <summary>The ankle's velocity, m/s.</summary>
        public Vec3 V;
        /// <summary>Some part of the foot stands, heel or toes.</summary>
        public bool Contact;
        public FootStage Stage;
        /// <summary>Radius of the ball round the ankle that should hold the truth in 68 % of cases, m.</summary>
        public double Sigma;
        /// <summary>Since the last optical measurement that was accepted, s; null when there was none.</summary>
        public double? Age;
    }

    /// <summary>`pose/body`: one coherent instant of the lower body, stage frame. What is not known is null.</summary>
    public struct BodyPose
    {
        public RigidPose? Head, Hips;
        public FootPose? Left, Right;
    }

    public enum IkMode
    {
        Stand,
        Walk,
    }

    /// <summary>IK target of one foot and its knee's hint, avatar frame.</summary>
    public struct IkFoot
    {
        /// <summary>Ankle, m.</summary>
        public Vec3 P;
        /// <summary>Foot to avatar.</summary>
        public Quat Q;
        /// <summary>Where the knee should point, m.</summary>
        public Vec3 Hint;
    }

    /// <summary>`pose/ik`: targets for an avatar that walks where its user walks in place.</summary>
    public struct IkTargets
    {
        public IkMode Mode;
        public IkFoot Left, Right;
        /// <summary>To add to the hips' standing height, m, at most 0.</summary>
        public double PelvisDy;
        /// <summary>The avatar's, forward, m/s.</summary>
        public double Speed;
        /// <summary>Where forward is, unit length, stage frame.</summary>
        public Vec3 Heading;
    }

    public enum GaitPhase
    {
        Stance,
        Ascending,
        MidSwing,
        Descending,
        TerminalSwing,
    }

    /// <summary>Gait of one foot.</summary>
    public struct FootGait
    {
        public GaitPhase Phase;
        /// <summary>Ankle above its standing height, m.</summary>
        public double Height;
        /// <summary>The ankle's, upwards, m/s.</summary>
        public double Vy;
    }

    /// <summary>`gait/state`: gait of the pair.</summary>
    public struct GaitState
    {
        public FootGait? Left, Right;
        /// <summary>Steps per second.</summary>
        public double Cadence;
        /// <summary>Of locomotion, forward, m/s.</summary>
        public double Speed;
        /// <summary>Since the start.</summary>
        public long Steps;
    }

    public enum GaitEventKind
    {
        HeelOff,
        ToeOff,
        MidSwing,
        TerminalSwing,
        FootStrike,
        FirstStep,
        Stop,
    }

    /// <summary>`gait/event`: something that happened at the envelope's `T`.</summary>
    public struct GaitEvent
    {
        /// <summary>Null for some of the pair's own events: first step and stop.</summary>
        public Side? Side;
        public GaitEventKind Event;
        /// <summary>Number of the step that it belongs to.</summary>
        public long Step;
    }
}
