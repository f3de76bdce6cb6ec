using System;
using System.Collections.Generic;

namespace Foottrack
{
    /// <summary>Finds lost messages by `seq` (SPEC, section 2).</summary>
    internal sealed class SequenceCounter
    {
        /// <summary>A forgotten run of a publisher only misses its next gap.</summary>
        private const int MostRuns = 4096;

        private readonly Dictionary<Run, long> _last = new Dictionary<Run, long>();

        /// <summary>Messages missed since the one before.</summary>
        public long Lost(StreamTopic topic, Envelope envelope)
        {
            var run = new Run(topic.Name, envelope.Src, envelope.Sid);
            long last, lost = 0;
            if (_last.TryGetValue(run, out last))
            {
                if (envelope.Seq <= last)
                {
                    return 0;
                }
                lost = envelope.Seq - last - 1;
            }
            else if (_last.Count >= MostRuns)
            {
                _last.Clear();
            }
            _last[run] = envelope.Seq;
            return lost;
        }

        private struct Run : IEquatable<Run>
        {
            private readonly string _topic, _src, _sid;

            public Run(string topic, string src, string sid)
            {
                _topic = topic;
                _src = src;
                _sid = sid;
            }

            public bool Equals(Run other)
            {
                return _sid == other._sid && _topic == other._topic && _src == other._src;
            }

            public override bool Equals(object other)
            {
                return other is Run && Equals((Run)other);
            }

            public override int GetHashCode()
            {
                return unchecked((_topic.GetHashCode() * 31 + _src.GetHashCode()) * 31 + _sid.GetHashCode());
            }
        }
    }
}
