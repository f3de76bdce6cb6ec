using System;

namespace Foottrack
{
    /// <summary>Why a connection has to end, for a person.</summary>
    internal sealed class LinkException : Exception
    {
        public enum Cause
        {
            Lost,
            Violation,
            Stall,
        }

        public readonly Cause Why;

        public LinkException(Cause why, string message) : base(message)
        {
            Why = why;
        }
    }
}
