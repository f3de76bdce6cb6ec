using System.Collections.Generic;
using System.Threading;

namespace Foottrack
{
    /// <summary>What was counted on one topic.</summary>
    public struct TopicStatistics
    {
        public long Messages;
        /// <summary>Messages missed, by `seq`.</summary>
        public long Gaps;
        /// <summary>Number of refusals; only those that happened.</summary>
        public Dictionary<Refusal, long> Refused;
        /// <summary>ns of <see cref="OwnClock"/>; 0 before the first.</summary>
        public long LastArrivalNs;

        internal static TopicStatistics Of(TopicCounters counters)
        {
            var made = new TopicStatistics
            {
                Messages = Interlocked.Read(ref counters.Messages),
                Gaps = Interlocked.Read(ref counters.Gaps),
                LastArrivalNs = Interlocked.Read(ref counters.LastArrivalNs),
                Refused = new Dictionary<Refusal, long>(),
            };
            for (int i = 0; i < counters.Refused.Length; i++)
            {
                long count = Interlocked.Read(ref counters.Refused[i]);
                if (count > 0)
                {
                    made.Refused[(Refusal)i] = count;
                }
            }
            return made;
        }
    }

    /// <summary>Everything that was counted since the start: a loss has a number and a name.</summary>
    public sealed class ConnectionStatistics
    {
        /// <summary>Of all three connections; how often the peer broke the rules, stalled, or met a mistake of ours.</summary>
        public long Connections, Violations, Stalls, Failures;
        /// <summary>How often the bus was found; the number of losses is one less.</summary>
        public long Welcomes;
        /// <summary>Id of the service's run.</summary>
        public string Session;
        public long BadAnswers;
        /// <summary>Of the bus clock; -1 while it is not known.</summary>
        public long UncertaintyNs;
        /// <summary>Head poses that were sent, and that were not.</summary>
        public long Sent, UnsentNoBus, UnsentFull, UnsentInvalid, UnsentCutOff;
        /// <summary>Messages that nobody came to take.</summary>
        public long Overflow;
        public readonly Dictionary<string, TopicStatistics> Topics = new Dictionary<string, TopicStatistics>();
        /// <summary>Refusals that name no topic.</summary>
        public TopicStatistics Unread;
    }
}
