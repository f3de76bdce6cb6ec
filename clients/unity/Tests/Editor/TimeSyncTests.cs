using NUnit.Framework;

namespace Foottrack.Tests
{
    public sealed class TimeSyncTests
    {
        private const long Second = 1000000000;
        private const long Ms = 1000000;

        [Test]
        public void TheQuickestExchangeOfABurstCounts()
        {
            var time = new TimeSync();
            time.OnExchange(0, 5000 * Second + 3 * Ms, 4 * Ms);
            time.OnExchange(10 * Ms, 5000 * Second + 11 * Ms, 12 * Ms);
            time.OnExchange(20 * Ms, 5000 * Second + 99 * Ms, 220 * Ms);
            time.OnBurstEnd();
            long offset;
            Assert.IsTrue(time.TryGetOffset(out offset));
            Assert.AreEqual(5000 * Second, offset);
            Assert.AreEqual(Ms, time.Uncertainty(11 * Ms));
        }

        [Test]
        public void ExchangesThatTookTooLongOrRanBackwardsCountForNothing()
        {
            var time = new TimeSync();
            time.OnExchange(0, 5, 129 * Ms);
            time.OnExchange(10, 5, 9);
            time.OnBurstEnd();
            long offset;
            Assert.IsFalse(time.TryGetOffset(out offset));
            Assert.IsFalse(time.IsFresh(0));
            Assert.AreEqual(-1, time.Uncertainty(0));
        }

        [Test]
        public void AWorseOneIsTakenOnlyWhenTheOldOneHasGrownWorseOrCannotBeTrue()
        {
            var time = new TimeSync();
            long offset;
            Burst(time, 0, 1000 * Second, 2 * Ms);
            // 1 ms, and 0.1 ms of drift: a half-width of 4 ms tells nothing new.
            Burst(time, Second, 1000 * Second + 2 * Ms, 8 * Ms);
            time.TryGetOffset(out offset);
            Assert.AreEqual(1000 * Second, offset);
            // 100 s later the old one is known within 11 ms.
            Burst(time, 100 * Second, 1000 * Second + 5 * Ms, 8 * Ms);
            time.TryGetOffset(out offset);
            Assert.AreEqual(1000 * Second + 5 * Ms, offset);
            // The host was asleep for an hour.
            Burst(time, 101 * Second, 4600 * Second, 20 * Ms);
            time.TryGetOffset(out offset);
            Assert.AreEqual(4600 * Second, offset);
        }

        [Test]
        public void AnOffsetGoesStaleAndIsForgotten()
        {
            var time = new TimeSync();
            Burst(time, 0, Second, Ms);
            Assert.IsTrue(time.IsFresh(10 * Second));
            Assert.IsFalse(time.IsFresh(11 * Second));
            long offset;
            Assert.IsTrue(time.TryGetOffset(out offset));
            time.Forget();
            Assert.IsFalse(time.TryGetOffset(out offset));
            Assert.AreEqual(0, offset);
        }

        private static void Burst(TimeSync time, long own, long offset, long roundTrip)
        {
            time.OnExchange(own, own + roundTrip / 2 + offset, own + roundTrip);
            time.OnBurstEnd();
        }
    }
}
