using System.Diagnostics;

namespace Foottrack
{
    /// <summary>This process's monotonic clock, ns. Its zero means nothing.</summary>
    public static class OwnClock
    {
        private const long NanosecondsPerSecond = 1000000000;

        public static long NowNs
        {
            get
            {
                long ticks = Stopwatch.GetTimestamp(), frequency = Stopwatch.Frequency;
                return ticks / frequency * NanosecondsPerSecond + ticks % frequency * NanosecondsPerSecond / frequency;
            }
        }
    }
}
