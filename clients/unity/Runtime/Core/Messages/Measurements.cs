namespace Foottrack
{
    /// <summary>`imu/*`: one sample, sensor frame. At least one of `Gyro` and `Q` is there.</summary>
    public struct Imu
    {
        /// <summary>Specific force, m/s^2: 9.81 upwards at rest.</summary>
        public Vec3 Acc;
        /// <summary>rad/s.</summary>
        public Vec3? Gyro;
        /// <summary>Sensor to a gravity-aligned frame, yaw arbitrary.</summary>
        public Quat? Q;
        /// <summary>The device's own counter, us.</summary>
        public long? TDev;
        /// <summary>Arrival on the host, bus clock, ns.</summary>
        public long TArr;
        /// <summary>0 unreliable to 3 high.</summary>
        public long? Accuracy;
    }

    /// <summary>Symmetric matrix, m^2.</summary>
    public struct Covariance
    {
        public double Xx, Xy, Xz, Yy, Yz, Zz;
    }

    /// <summary>`marker/*`, `depth/*`: where a foot's optical target was seen, head frame.</summary>
    public struct Optical
    {
        public Vec3 P;
        /// <summary>Target to head: the two solutions of the planar pose.</summary>
        public Quat? Q, QAlt;
        public Covariance Cov;
        /// <summary>Range by depth / range by apparent size.</summary>
        public double? SizeRatio;
        public double? ReprojPx;
        public double EdgePx;
        public long Frame;
    }

    /// <summary>`head/pose`: the headset in the stage.</summary>
    public struct HeadPose
    {
        /// <summary>Null when not tracked.</summary>
        public Vec3? P;
        /// <summary>Head to stage; null when not tracked.</summary>
        public Quat? Q;
        public bool Tracked;
        /// <summary>Changes when the headset's stage was recentred or jumped.</summary>
        public long Origin;
        /// <summary>Old stage to new, in the first message of a new origin, when it is known.</summary>
        public RigidPose? Moved;
    }

    /// <summary>`truth/*`: the ankle in the stage, from a reference system.</summary>
    public struct Truth
    {
        public Vec3 P;
        public Quat Q;
    }

    /// <summary>`camera/preview`.</summary>
    public struct CameraPreview
    {
        public byte[] Jpeg;
    }
}
