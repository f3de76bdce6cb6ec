using System;

namespace NUnit.Framework
{
    // As much of NUnit as Tests/Editor uses: the same tests run in Unity's test runner and under mono.
    [AttributeUsage(AttributeTargets.Method)]
    public sealed class TestAttribute : Attribute
    {
    }

    public static class Assert
    {
        public static void IsTrue(bool condition)
        {
            Check(condition, "true is due");
        }

        public static void IsFalse(bool condition)
        {
            Check(!condition, "false is due");
        }

        public static void AreEqual<T>(T expected, T found)
        {
            Check(Equals(expected, found), expected + " is due, not " + found);
        }

        public static void AreEqual(double expected, double found, double within)
        {
            Check(Math.Abs(expected - found) <= within, expected + " is due, not " + found);
        }

        private static void Check(bool condition, string message)
        {
            if (!condition)
            {
                throw new InvalidOperationException(message);
            }
        }
    }
}
