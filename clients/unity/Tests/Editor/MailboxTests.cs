using NUnit.Framework;

namespace Foottrack.Tests
{
    public sealed class MailboxTests
    {
        [Test]
        public void EventsComeInOrderAcrossTheRingsEnd()
        {
            var waiting = new Waiting<int>(4, 32);
            int next = 0, due = 0, item;
            for (int round = 0; round < 20; round++)
            {
                for (int i = 0; i < 3 + round % 3; i++)
                {
                    waiting.Put(next++);
                }
                while (round % 4 == 3 && waiting.TryTake(out item))
                {
                    Assert.AreEqual(due++, item);
                }
            }
            Assert.AreEqual(next, due);
            Assert.AreEqual(0, waiting.Lost);
        }

        [Test]
        public void BeyondTheLimitTheOldestAreLostAndCounted()
        {
            var waiting = new Waiting<int>(2, 5);
            for (int i = 0; i < 12; i++)
            {
                waiting.Put(i);
            }
            int item;
            Assert.AreEqual(7, waiting.Lost);
            Assert.IsTrue(waiting.TryTake(out item));
            Assert.AreEqual(7, item);
        }

        [Test]
        public void TheNewestStays()
        {
            var latest = new Latest<int>();
            Received<int> newest;
            Assert.IsFalse(latest.TryGet(out newest));
            int body = 1;
            latest.Put(new Envelope { Seq = 1 }, ref body, 10);
            body = 2;
            latest.Put(new Envelope { Seq = 2 }, ref body, 20);
            Assert.IsTrue(latest.TryGet(out newest) && latest.TryGet(out newest));
            Assert.AreEqual(2, newest.Body);
            Assert.AreEqual(2, newest.Envelope.Seq);
            Assert.AreEqual(20, newest.ArrivalNs);
        }

        [Test]
        public void GapsAreCountedPerRunAndRepeatsAreNone()
        {
            var counter = new SequenceCounter();
            byte[] name = Utf8.Bytes("user/pose/body");
            StreamTopic topic = StreamTopic.Parse(name, 0, name.Length);
            Assert.AreEqual(0, counter.Lost(topic, Of("a", 7)));
            Assert.AreEqual(0, counter.Lost(topic, Of("a", 8)));
            Assert.AreEqual(3, counter.Lost(topic, Of("a", 12)));
            Assert.AreEqual(0, counter.Lost(topic, Of("a", 12)));
            Assert.AreEqual(0, counter.Lost(topic, Of("a", 3)));
            Assert.AreEqual(0, counter.Lost(topic, Of("a", 13)));
            Assert.AreEqual(0, counter.Lost(topic, Of("b", 0)));
            Assert.AreEqual(1, counter.Lost(topic, Of("a", 15)));
        }

        private static Envelope Of(string sid, long seq)
        {
            return new Envelope { Src = "fusion", Sid = sid, Seq = seq };
        }
    }
}
