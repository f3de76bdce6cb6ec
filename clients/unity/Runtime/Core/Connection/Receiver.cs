using System;
using System.Collections.Generic;
using System.Threading;

namespace Foottrack
{
    /// <summary>Takes what the receiving thread read to where the main thread finds it, and counts it.</summary>
    internal sealed class Receiver
    {
        /// <summary>A main thread that does not come back for so many messages loses the oldest; that is counted.</summary>
        public const int MostWaiting = 10000;
        private const int FirstWaiting = 256;
        private const long RefusalPeriodNs = 1000000000;

        public readonly Latest<BodyPose> BodyPose = new Latest<BodyPose>();
        public readonly Latest<IkTargets> IkTargets = new Latest<IkTargets>();
        public readonly Latest<GaitState> GaitState = new Latest<GaitState>();
        public readonly Waiting<Received<GaitEvent>> GaitEvents =
            new Waiting<Received<GaitEvent>>(FirstWaiting, MostWaiting);
        public readonly Waiting<Message> Others = new Waiting<Message>(FirstWaiting, MostWaiting);

        private readonly MessageDecoder _decoder = new MessageDecoder();
        private readonly SequenceCounter _sequences = new SequenceCounter();
        private readonly Action<Session> _onSession;
        private readonly TopicCounters _unread = new TopicCounters();
        private readonly Dictionary<string, StreamTopic> _topics = new Dictionary<string, StreamTopic>();
        private RefusalReport _report;
        private long _nextReportNs = long.MinValue;

        /// <param name="onSession">Called by the receiving thread.</param>
        public Receiver(Action<Session> onSession)
        {
            _onSession = onSession;
        }

        /// <summary>Refusals that name no topic, by reason.</summary>
        public TopicCounters Unread { get { return _unread; } }

        public void Receive(FrameBuffer frames)
        {
            long now = OwnClock.NowNs;
            Refusal refusal = _decoder.Decode(frames);
            StreamTopic topic = _decoder.Topic;
            if (topic != null)
            {
                Remember(topic);
            }
            if (refusal != Refusal.None)
            {
                (topic != null ? topic.Counters : _unread).Refuse(refusal);
                Report(refusal, topic, now);
                return;
            }
            topic.Counters.Accept(now, _sequences.Lost(topic, _decoder.Envelope));
            HandOver(topic, now);
        }

        public RefusalReport TakeReport()
        {
            return Interlocked.Exchange(ref _report, null);
        }

        public List<StreamTopic> Topics()
        {
            lock (_topics)
            {
                return new List<StreamTopic>(_topics.Values);
            }
        }

        private void HandOver(StreamTopic topic, long now)
        {
            switch (topic.Kind)
            {
                case StreamKind.BodyPose: BodyPose.Put(_decoder.Envelope, ref _decoder.BodyPose, now); break;
                case StreamKind.IkTargets: IkTargets.Put(_decoder.Envelope, ref _decoder.IkTargets, now); break;
                case StreamKind.GaitState: GaitState.Put(_decoder.Envelope, ref _decoder.GaitState, now); break;
                case StreamKind.GaitEvent:
                    GaitEvents.Put(new Received<GaitEvent>
                    {
                        Envelope = _decoder.Envelope,
                        Body = _decoder.GaitEvent,
                        ArrivalNs = now,
                    });
                    break;
                default:
                    Others.Put(new Message
                    {
                        Topic = topic.Name,
                        Kind = topic.Kind,
                        Envelope = _decoder.Envelope,
                        Body = _decoder.Body,
                        ArrivalNs = now,
                    });
                    break;
            }
            if (topic.Kind == StreamKind.Session)
            {
                _onSession((Session)_decoder.Body);
            }
        }

        private void Remember(StreamTopic topic)
        {
            if (topic.Counters.IsListed)
            {
                return;
            }
            topic.Counters.IsListed = true;
            lock (_topics)
            {
                if (_topics.Count < MessageDecoder.MostTopics)
                {
                    _topics[topic.Name] = topic;
                }
            }
        }

        /// <summary>At most once a second, since a text takes memory.</summary>
        private void Report(Refusal reason, StreamTopic topic, long now)
        {
            if (now < _nextReportNs)
            {
                return;
            }
            _nextReportNs = now + RefusalPeriodNs;
            string name = topic != null ? topic.Name : "";
            string text = reason == Refusal.Version
                ? "protocol " + _decoder.Major + " on " + name + ", this package speaks "
                    + MessageDecoder.ProtocolMajor + ": update the older one of package and service"
                : "what came" + (topic != null ? " on " + name : "") + " was no message: " + reason;
            Interlocked.Exchange(ref _report, new RefusalReport(reason, name, text));
        }
    }
}
