using System;
using System.Collections.Generic;
using System.Reflection;
using NUnit.Framework;

namespace Foottrack.Tests
{
    /// <summary>Runs what Unity's test runner would run.</summary>
    internal static class EditorTests
    {
        public static int Run()
        {
            foreach (Type type in Assembly.GetExecutingAssembly().GetTypes())
            {
                foreach (MethodInfo method in type.GetMethods())
                {
                    if (method.GetCustomAttributes(typeof(TestAttribute), false).Length > 0)
                    {
                        Program.Say(new Dictionary<string, object>
                        {
                            { "test", type.Name + "." + method.Name }, { "fault", FaultOf(type, method) },
                        });
                    }
                }
            }
            return 0;
        }

        private static string FaultOf(Type type, MethodInfo method)
        {
            try
            {
                method.Invoke(Activator.CreateInstance(type), null);
                return null;
            }
            catch (TargetInvocationException e)
            {
                return e.InnerException.ToString();
            }
        }
    }
}
