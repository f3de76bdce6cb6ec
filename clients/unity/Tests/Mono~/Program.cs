using System;

namespace Foottrack.Tests
{
    /// <summary>What pytest runs under mono, since Unity itself is not there. It answers with lines of JSON.</summary>
    internal static class Program
    {
        public static int Main(string[] arguments)
        {
            switch (arguments[0])
            {
                case "vectors": return Vectors.Run(arguments[1]);
                case "tests": return EditorTests.Run();
                case "allocations": return Allocations.Run(arguments[1], int.Parse(arguments[2]));
                case "game": return Game.Run(arguments);
                case "requests": return Requests.Run(arguments);
                case "bench": return Bench.Run(arguments);
                default:
                    Console.Error.WriteLine("unknown: " + arguments[0]);
                    return 2;
            }
        }

        public static void Say(object what)
        {
            lock (Console.Out)
            {
                Console.Out.WriteLine("LINE " + Json.Of(what));
                Console.Out.Flush();
            }
        }
    }
}
