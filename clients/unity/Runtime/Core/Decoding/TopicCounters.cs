using System.Threading;

namespace Foottrack
{
    /// <summary>Counted by the receiving thread, read by any.</summary>
    internal sealed class TopicCounters
    {
        public readonly long[] Refused = new long[(int)Refusal.Body + 1];
        /// <summary>Of the receiving thread alone.</summary>
        public bool IsListed;
        public long Messages;
        public long Gaps;
        /// <summary>ns of <see cref="OwnClock"/>.</summary>
        public long LastArrivalNs;

        public void Accept(long arrivalNs, long lost)
        {
            Interlocked.Increment(ref Messages);
            Interlocked.Add(ref Gaps, lost);
            Interlocked.Exchange(ref LastArrivalNs, arrivalNs);
        }

        public void Refuse(Refusal reason)
        {
            Interlocked.Increment(ref Refused[(int)reason]);
        }
    }
}
