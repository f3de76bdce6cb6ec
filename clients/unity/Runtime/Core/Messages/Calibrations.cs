namespace Foottrack
{
    public enum CalibrationKind
    {
        Body,
        Floor,
        Heading,
        Imu,
        Mount,
    }

    /// <summary>`calibration`: what a calibration found.</summary>
    public struct Calibration
    {
        public CalibrationKind Kind;
        /// <summary>BodyValues, FloorValues, HeadingValues, ImuValues or MountValues, as `Kind` says.</summary>
        public object Values;
    }

    /// <summary>The user's measures, m.</summary>
    public struct BodyValues
    {
        public double Height, Thigh, Shank, Torso, HipWidth, HipBack;
        /// <summary>What the head nods about, from the eyes; null when it was not measured.</summary>
        public double? NeckDown, NeckBack;
    }

    public struct FloorValues
    {
        /// <summary>Floor above the stage's y = 0, m.</summary>
        public double Height;
    }

    /// <summary>Yaw of each IMU's own frame in the stage, rad.</summary>
    public struct PerSideYaw
    {
        public double? Left, Right;
    }

    public struct HeadingValues
    {
        /// <summary>The user's forward against the stage's -Z, positive to the left, rad.</summary>
        public double Yaw;
        public PerSideYaw ImuYaw;
    }

    /// <summary>What is known of one foot's IMU; `P` and `Q` are the sensor in the foot.</summary>
    public struct ImuValues
    {
        public Side Side;
        public Vec3 AccBias, GyroBias, P;
        public Quat Q;
    }

    /// <summary>Correction of the configured camera mount whose hash is `Base`.</summary>
    public struct MountValues
    {
        public Vec3 P;
        public Quat Q;
        /// <summary>Standard deviation per axis, m and rad.</summary>
        public double SigmaP, SigmaQ;
        public string Base;
    }
}
