namespace Foottrack
{
    /// <summary>What every message says besides its body. Stamps are ns of the bus clock.</summary>
    public struct Envelope
    {
        /// <summary>Who published, and the random id of that run of his.</summary>
        public string Src, Sid;
        public long Seq;
        /// <summary>When the body was true, and when it was handed to ZeroMQ.</summary>
        public long T, TPub;
        /// <summary>The publisher's own inputs were healthy.</summary>
        public bool Valid;
    }

    /// <summary>A message with its body.</summary>
    public struct Received<T>
    {
        public Envelope Envelope;
        public T Body;
        /// <summary>When it was decoded, ns of <see cref="OwnClock"/>.</summary>
        public long ArrivalNs;
    }

    /// <summary>A message of a stream that has no typed place of its own; `Body` is boxed.</summary>
    public sealed class Message
    {
        public string Topic;
        public StreamKind Kind;
        public Envelope Envelope;
        public object Body;
        /// <summary>When it was decoded, ns of <see cref="OwnClock"/>.</summary>
        public long ArrivalNs;
    }

    /// <summary>Why something that came was no message (SPEC, section 10).</summary>
    public enum Refusal
    {
        None,
        Frames,
        Topic,
        Oversized,
        Msgpack,
        Depth,
        Envelope,
        Version,
        NotFinite,
        Body,
    }

    /// <summary>A refusal, for a person.</summary>
    public sealed class RefusalReport
    {
        public readonly Refusal Reason;
        /// <summary>Empty where it could not be read.</summary>
        public readonly string Topic;
        public readonly string Text;

        public RefusalReport(Refusal reason, string topic, string text)
        {
            Reason = reason;
            Topic = topic;
            Text = text;
        }
    }
}
