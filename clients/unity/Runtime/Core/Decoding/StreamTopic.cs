using System;

namespace Foottrack
{
    /// <summary>The streams of this version of the wire (SPEC, section 5).</summary>
    public enum StreamKind
    {
        ImuLeft,
        ImuRight,
        MarkerLeft,
        MarkerRight,
        DepthLeft,
        DepthRight,
        HeadPose,
        TruthLeft,
        TruthRight,
        Calibration,
        CameraPreview,
        BodyPose,
        IkTargets,
        GaitState,
        GaitEvent,
        Session,
        Health,
        Log,
    }

    /// <summary>A topic that was seen, and what was counted on it.</summary>
    public sealed class StreamTopic
    {
        public const int MaxBytes = 128;
        private const int MaxUserLength = 32;

        private static readonly string[] Streams =
        {
            "imu/left", "imu/right", "marker/left", "marker/right", "depth/left", "depth/right", "head/pose",
            "truth/left", "truth/right", "calibration", "camera/preview", "pose/body", "pose/ik", "gait/state",
            "gait/event", "session", "health", "log",
        };

        public readonly string Name;
        public readonly string User;
        public readonly StreamKind Kind;
        internal readonly TopicCounters Counters = new TopicCounters();

        private StreamTopic(string name, string user, StreamKind kind)
        {
            Name = name;
            User = user;
            Kind = kind;
        }

        /// <summary>Null for what is no topic of this version.</summary>
        internal static StreamTopic Parse(byte[] bytes, int offset, int length)
        {
            if (length > MaxBytes || !Utf8.IsValid(bytes, offset, length))
            {
                return null;
            }
            string name = Utf8.Text(bytes, offset, length);
            int slash = name.IndexOf('/');
            if (slash < 0 || !IsUser(name.Substring(0, slash)))
            {
                return null;
            }
            string user = name.Substring(0, slash);
            int stream = Array.IndexOf(Streams, name.Substring(slash + 1));
            bool isSystem = stream >= (int)StreamKind.Session;
            return stream < 0 || isSystem != (user == "sys") ? null : new StreamTopic(name, user, (StreamKind)stream);
        }

        /// <summary>Whether it matches `[a-z0-9][a-z0-9-]{0,31}`.</summary>
        internal static bool IsUser(string name)
        {
            if (name.Length == 0 || name.Length > MaxUserLength || name[0] == '-')
            {
                return false;
            }
            foreach (char c in name)
            {
                if (!(c >= 'a' && c <= 'z') && !(c >= '0' && c <= '9') && c != '-')
                {
                    return false;
                }
            }
            return true;
        }
    }
}
