using System.Collections.Generic;

namespace Foottrack
{
    public struct ProtocolVersion
    {
        public long Major, Minor;
    }

    /// <summary>The same instant on the bus clock and in Unix time, ns.</summary>
    public struct ClockAnchor
    {
        public long Bus, Unix;
    }

    /// <summary>`sys/session`, and the answer to `hello`: who serves this bus.</summary>
    public struct Session
    {
        /// <summary>Random id of this run of the service.</summary>
        public string Id;
        public ProtocolVersion Protocol;
        public ClockAnchor Clock;
        public string[] Users;
        public string ConfigHash;
    }

    public enum NodeState
    {
        Starting,
        Running,
        Restarting,
        Failed,
        Stopped,
    }

    public struct NodeHealth
    {
        public NodeState State;
        public long Restarts;
        public string Error;
    }

    public struct TopicHealth
    {
        public double Hz;
        public long Messages, Gaps;
        public Dictionary<string, long> Drops;
        public double? Age;
    }

    public struct FilterHealth
    {
        public Dictionary<string, long> Accepted, Rejected;
    }

    /// <summary>Arrival of an IMU sample to the hand-over of its pose, ms.</summary>
    public struct Latency
    {
        public double P50, P99;
    }

    /// <summary>`sys/health`: how the service is.</summary>
    public struct Health
    {
        public Dictionary<string, TopicHealth> Topics;
        public Dictionary<string, FilterHealth> Filters;
        public Dictionary<string, NodeHealth> Nodes;
        public Dictionary<string, long> Drops;
        public Latency? LatencyMs;
    }

    public enum LogLevel
    {
        Warning,
        Error,
        Critical,
    }

    /// <summary>`sys/log`.</summary>
    public struct LogRecord
    {
        public LogLevel Level;
        public string Logger, Message;
    }
}
