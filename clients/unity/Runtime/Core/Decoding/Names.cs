namespace Foottrack
{
    /// <summary>Keys and enumerations as they are on the wire; an enumeration's names stand in the enum's order.</summary>
    internal static class Names
    {
        public static readonly byte[] V = Of("v"), Src = Of("src"), Sid = Of("sid"), Seq = Of("seq"), T = Of("t"),
            TPub = Of("t_pub"), Valid = Of("valid"), Data = Of("data");

        public static readonly byte[] P = Of("p"), Q = Of("q"), Head = Of("head"), Hips = Of("hips"), Left = Of("left"),
            Right = Of("right"), Hip = Of("hip"), Knee = Of("knee"), Ankle = Of("ankle"), Toe = Of("toe"),
            Contact = Of("contact"), Stage = Of("stage"), Sigma = Of("sigma"), Age = Of("age"), Mode = Of("mode"),
            Hint = Of("hint"), PelvisDy = Of("pelvis_dy"), Speed = Of("speed"), Heading = Of("heading"),
            Phase = Of("phase"), Height = Of("height"), Vy = Of("vy"), Cadence = Of("cadence"), Steps = Of("steps"),
            Side = Of("side"), Event = Of("event"), Step = Of("step");

        public static readonly byte[] Acc = Of("acc"), Gyro = Of("gyro"), TDev = Of("t_dev"), TArr = Of("t_arr"),
            Accuracy = Of("accuracy"), QAlt = Of("q_alt"), Cov = Of("cov"), SizeRatio = Of("size_ratio"),
            ReprojPx = Of("reproj_px"), EdgePx = Of("edge_px"), Frame = Of("frame"), Tracked = Of("tracked"),
            Origin = Of("origin"), Moved = Of("moved"), Jpeg = Of("jpeg");

        public static readonly byte[] Kind = Of("kind"), Values = Of("values"), Thigh = Of("thigh"),
            Shank = Of("shank"), Torso = Of("torso"), HipWidth = Of("hip_width"), HipBack = Of("hip_back"),
            NeckDown = Of("neck_down"), NeckBack = Of("neck_back"),
            Yaw = Of("yaw"), ImuYaw = Of("imu_yaw"), AccBias = Of("acc_bias"), GyroBias = Of("gyro_bias"),
            SigmaP = Of("sigma_p"), SigmaQ = Of("sigma_q"), Base = Of("base");

        public static readonly byte[] Session = Of("session"), Protocol = Of("protocol"), Major = Of("major"),
            Minor = Of("minor"), Clock = Of("clock"), Bus = Of("bus"), Unix = Of("unix"), Users = Of("users"),
            ConfigHash = Of("config_hash"), Topics = Of("topics"), Filters = Of("filters"), Nodes = Of("nodes"),
            Drops = Of("drops"), LatencyMs = Of("latency_ms"), Hz = Of("hz"), Messages = Of("messages"),
            Gaps = Of("gaps"), Accepted = Of("accepted"), Rejected = Of("rejected"), State = Of("state"),
            Restarts = Of("restarts"), Error = Of("error"), P50 = Of("p50"), P99 = Of("p99"), Level = Of("level"),
            Logger = Of("logger"), Text = Of("message");

        public static readonly byte[] Cmd = Of("cmd"), Args = Of("args"), Ok = Of("ok"), Result = Of("result"),
            Hello = Of("hello"), Time = Of("time");

        public static readonly byte[][] Sides = { Left, Right };
        public static readonly byte[][] FootStages =
            { Of("marker"), Of("depth"), Of("inertial"), Of("coasting"), Of("lost") };
        public static readonly byte[][] IkModes = { Of("stand"), Of("walk") };
        public static readonly byte[][] GaitPhases =
            { Of("stance"), Of("ascending"), Of("mid_swing"), Of("descending"), Of("terminal_swing") };
        public static readonly byte[][] GaitEvents =
        {
            Of("heel_off"), Of("toe_off"), Of("mid_swing"), Of("terminal_swing"), Of("foot_strike"), Of("first_step"),
            Of("stop"),
        };
        public static readonly byte[][] CalibrationKinds =
            { Of("body"), Of("floor"), Of("heading"), Of("imu"), Of("mount") };
        public static readonly byte[][] NodeStates =
            { Of("starting"), Of("running"), Of("restarting"), Of("failed"), Of("stopped") };
        public static readonly byte[][] LogLevels = { Of("warning"), Error, Of("critical") };

        private static byte[] Of(string name)
        {
            return Utf8.Bytes(name);
        }
    }
}
