using System;
using NUnit.Framework;

namespace Foottrack.Tests
{
    public sealed class HeadEncoderTests
    {
        private static readonly Vec3 Eye = new Vec3(0.1, 1.6, -0.2);
        private static readonly Quat Upright = new Quat(0.0, 0.0, 0.0, 1.0);

        [Test]
        public void WhatAReceiverWouldRefuseIsNotSent()
        {
            AssertSendable(true, Eye, Upright, true);
            AssertSendable(true, null, null, false);
            AssertSendable(false, null, Upright, true);
            AssertSendable(false, Eye, null, true);
            AssertSendable(false, new Vec3(0.0, double.NaN, 0.0), Upright, true);
            AssertSendable(false, new Vec3(double.NegativeInfinity, 0.0, 0.0), Upright, true);
            AssertSendable(false, Eye, new Quat(0.0, 0.0, 0.0, 0.99), true);
            AssertSendable(false, Eye, new Quat(0.0, 0.0, double.NaN, 1.0), true);
            AssertSendable(false, new Vec3(0.0, double.NaN, 0.0), null, false);
        }

        [Test]
        public void ANewOriginMaySayHowItMoved()
        {
            var head = new HeadPose
            {
                P = Eye, Q = Upright, Tracked = true, Origin = 300, Moved = new RigidPose(Eye, new Quat(0, 1, 0, 0)),
            };
            Assert.IsTrue(HeadEncoder.IsSendable(ref head));
            var encoder = new HeadEncoder("user", "unity", "5d41402a");
            encoder.CountLost();
            var bytes = new byte[encoder.MaxBytes];
            int length = encoder.Encode(bytes, ref head, -5, long.MaxValue, true);
            var decoder = new MessageDecoder();
            Assert.AreEqual(Refusal.None, decoder.Decode(Unframed(bytes, length)));
            var found = (HeadPose)decoder.Body;
            Assert.AreEqual("user/head/pose", decoder.Topic.Name);
            Assert.AreEqual(1L, decoder.Envelope.Seq);
            Assert.AreEqual(-5L, decoder.Envelope.T);
            Assert.AreEqual(long.MaxValue, decoder.Envelope.TPub);
            Assert.AreEqual(300L, found.Origin);
            Assert.AreEqual(1.6, found.P.Value.Y);
            Assert.AreEqual(1.0, found.Moved.Value.Q.Y);
        }

        [Test]
        public void NamesThatHaveNoPlaceOnTheWireAreRefusedAtOnce()
        {
            foreach (string user in new[] { "", "sys", "User", "-a", "a/b", new string('a', 33) })
            {
                Assert.IsTrue(Throws(user, "unity"));
            }
            Assert.IsTrue(Throws("user", new string('x', 101)));
            Assert.IsFalse(Throws(new string('a', 32), new string('x', 100)));
        }

        private static bool Throws(string user, string source)
        {
            try
            {
                return new HeadEncoder(user, source, "5d41402a") == null;
            }
            catch (ArgumentException)
            {
                return true;
            }
        }

        private static void AssertSendable(bool due, Vec3? p, Quat? q, bool tracked)
        {
            var head = new HeadPose { P = p, Q = q, Tracked = tracked };
            Assert.AreEqual(due, HeadEncoder.IsSendable(ref head));
        }

        /// <summary>Frame by frame as a peer would read it: short topic, long payload.</summary>
        private static FrameBuffer Unframed(byte[] bytes, int length)
        {
            var frames = new FrameBuffer();
            int topic = bytes[1], payload = 2 + topic + 9;
            Assert.AreEqual(ZmtpConnection.More, bytes[0]);
            Assert.AreEqual(ZmtpConnection.Long, bytes[2 + topic]);
            Assert.AreEqual(length - payload, bytes[payload - 2] * 256 + bytes[payload - 1]);
            Array.Copy(bytes, 2, frames.Bytes, frames.Add(topic), topic);
            int at = frames.Add(length - payload);
            Array.Copy(bytes, payload, frames.Bytes, at, length - payload);
            return frames;
        }
    }
}
