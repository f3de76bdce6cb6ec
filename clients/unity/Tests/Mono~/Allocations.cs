using System;
using System.Collections.Generic;
using System.IO;

namespace Foottrack.Tests
{
    /// <summary>
    /// Garbage made by decoding, counting, handing over and taking out, for each message of a file (as Vectors takes
    /// them), after a warm-up. Only collections tell: what is in mono's nursery, GC.GetTotalMemory does not count.
    /// </summary>
    internal static class Allocations
    {
        private const int WarmUp = 2000;

        public static int Run(string path, int messages)
        {
            foreach (string line in File.ReadLines(path))
            {
                var receiver = new Receiver(session => { });
                var frames = new FrameBuffer();
                Vectors.Fill(frames, line);
                for (int i = 0; i < WarmUp; i++)
                {
                    Pass(receiver, frames);
                }
                GC.Collect();
                int collections = GC.CollectionCount(0);
                long began = OwnClock.NowNs;
                for (int i = 0; i < messages; i++)
                {
                    Pass(receiver, frames);
                }
                long took = OwnClock.NowNs - began;
                Program.Say(new Dictionary<string, object>
                {
                    { "collections", GC.CollectionCount(0) - collections },
                    { "ns_per_message", took / messages },
                    { "decoded", receiver.Topics()[0].Counters.Messages },
                });
            }
            return 0;
        }

        private static void Pass(Receiver receiver, FrameBuffer frames)
        {
            Received<BodyPose> body;
            Received<IkTargets> targets;
            Received<GaitState> state;
            Received<GaitEvent> gait;
            Message other;
            receiver.Receive(frames);
            receiver.BodyPose.TryGet(out body);
            receiver.IkTargets.TryGet(out targets);
            receiver.GaitState.TryGet(out state);
            receiver.GaitEvents.TryTake(out gait);
            receiver.Others.TryTake(out other);
        }
    }
}
