using System;
using System.Collections.Generic;
using System.IO;

namespace Foottrack.Tests
{
    /// <summary>
    /// Decodes messages from a file, a line each: the frames in hexadecimal, each with a space behind it. Says for each
    /// what came of it.
    /// </summary>
    internal static class Vectors
    {
        public static int Run(string path)
        {
            var decoder = new MessageDecoder();
            var frames = new FrameBuffer();
            foreach (string line in File.ReadLines(path))
            {
                Fill(frames, line);
                Refusal refusal = decoder.Decode(frames);
                Program.Say(refusal != Refusal.None
                    ? new Dictionary<string, object> { { "refusal", refusal } }
                    : new Dictionary<string, object>
                    {
                        { "topic", decoder.Topic.Name }, { "envelope", decoder.Envelope }, { "data", BodyOf(decoder) },
                    });
            }
            return 0;
        }

        public static void Fill(FrameBuffer frames, string line)
        {
            frames.Clear();
            string[] words = line.Split(' ');
            for (int i = 0; i < words.Length - 1; i++)
            {
                int at = frames.Add(words[i].Length / 2);
                for (int digit = 0; at >= 0 && digit < words[i].Length; digit += 2)
                {
                    frames.Bytes[at + digit / 2] = Convert.ToByte(words[i].Substring(digit, 2), 16);
                }
            }
        }

        private static object BodyOf(MessageDecoder decoder)
        {
            switch (decoder.Topic.Kind)
            {
                case StreamKind.BodyPose: return decoder.BodyPose;
                case StreamKind.IkTargets: return decoder.IkTargets;
                case StreamKind.GaitState: return decoder.GaitState;
                case StreamKind.GaitEvent: return decoder.GaitEvent;
                default: return decoder.Body;
            }
        }
    }
}
