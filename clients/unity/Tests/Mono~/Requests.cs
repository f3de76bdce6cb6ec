using System;
using System.Collections.Generic;
using System.Threading;

namespace Foottrack.Tests
{
    /// <summary>Asks the service all at once, and tells the answers in their order.</summary>
    internal static class Requests
    {
        private const int TimeoutMs = 20000;

        /// <summary>
        /// Arguments: "requests", three ports, a timeout in ms, then the commands, each with its arguments as in
        /// "calibrate/body?height=9.5". A command "leave" disposes of the connection.
        /// </summary>
        public static int Run(string[] arguments)
        {
            var asked = new List<ControlRequest>();
            using (var connection = new FoottrackConnection(new ConnectionSettings
            {
                IngressPort = int.Parse(arguments[1]),
                EgressPort = int.Parse(arguments[2]),
                ControlPort = int.Parse(arguments[3]),
            }))
            {
                connection.Start();
                bool leaves = false;
                for (int i = 5; i < arguments.Length; i++)
                {
                    leaves = leaves || arguments[i] == "leave";
                    if (arguments[i] != "leave")
                    {
                        string[] parts = arguments[i].Split('?');
                        asked.Add(connection.Request(parts[0], Arguments(parts), int.Parse(arguments[4])));
                    }
                }
                int waited = 0;
                while (!leaves && waited < TimeoutMs && !asked.TrueForAll(request => request.IsDone))
                {
                    Thread.Sleep(1);
                    waited++;
                }
            }
            var answers = new List<object>();
            foreach (ControlRequest request in asked)
            {
                answers.Add(new Dictionary<string, object>
                {
                    { "ok", request.IsOk },
                    { "result", request.Result },
                    { "code", request.Code },
                    { "message", request.Message },
                });
            }
            Program.Say(new Dictionary<string, object> { { "kind", "answers" }, { "answers", answers } });
            return 0;
        }

        private static Dictionary<string, object> Arguments(string[] parts)
        {
            var made = new Dictionary<string, object>();
            if (parts.Length > 1)
            {
                string[] pair = parts[1].Split('=');
                double number;
                bool isNumber = double.TryParse(pair[1], out number);
                made[pair[0]] = isNumber ? (object)number : pair[1];
            }
            return made;
        }
    }
}
