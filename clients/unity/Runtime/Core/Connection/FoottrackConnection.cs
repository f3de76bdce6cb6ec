using System;
using System.Collections.Generic;

namespace Foottrack
{
    /// <summary>Where the service is, and what is wanted of it.</summary>
    public sealed class ConnectionSettings
    {
        public string Host = "127.0.0.1";
        public int IngressPort = 7701;
        public int EgressPort = 7702;
        public int ControlPort = 7703;
        /// <summary>Whose feet: the first part of the topics.</summary>
        public string User = "user";
        /// <summary>Beginnings of this user's streams that are wanted.</summary>
        public string[] Streams = { "pose/", "gait/", "calibration" };
        /// <summary>What this client calls itself in what it publishes.</summary>
        public string Source = "unity";
    }

    /// <summary>
    /// The way to a foottrack service, for any .NET program. Three threads connect, receive and decode, publish and
    /// keep the time, and connect again when the service was restarted; nothing here ever waits for the network.
    /// Poses are the newest ones, events come in order and complete.
    /// </summary>
    public sealed class FoottrackConnection : IDisposable
    {
        private readonly TimeSync _time = new TimeSync();
        private readonly Receiver _receiver;
        private readonly EgressLink _egress;
        private readonly IngressLink _ingress;
        private readonly ControlLink _control;
        private readonly RequestLink _requests;

        /// <summary>Throws ArgumentException for names that have no place on the wire.</summary>
        public FoottrackConnection(ConnectionSettings settings)
        {
            var encoder = new HeadEncoder(settings.User, settings.Source, Guid.NewGuid().ToString("N").Substring(0, 12));
            var prefixes = new List<string> { "sys/session" };
            foreach (string stream in settings.Streams)
            {
                prefixes.Add(settings.User + "/" + stream);
            }
            _control = new ControlLink(settings.Host, settings.ControlPort, _time);
            _requests = new RequestLink(settings.Host, settings.ControlPort);
            _receiver = new Receiver(_control.OnSession);
            _egress = new EgressLink(settings.Host, settings.EgressPort, prefixes, _receiver);
            _ingress = new IngressLink(settings.Host, settings.IngressPort, encoder);
        }

        /// <summary>The bus is there, and nothing is missed.</summary>
        public bool IsLive { get { return _egress.IsLive; } }

        /// <summary>The bus takes what is published.</summary>
        public bool IsPublishing { get { return _ingress.IsLive; } }

        /// <summary>The bus clock is known, so that what is published is valid.</summary>
        public bool IsSynchronised { get { return _time.IsFresh(OwnClock.NowNs); } }

        /// <summary>Why the service is not there, for a person; empty when it is.</summary>
        public string Fault
        {
            get
            {
                return _egress.Fault.Length > 0 ? _egress.Fault
                    : _ingress.Fault.Length > 0 ? _ingress.Fault
                    : _control.Fault;
            }
        }

        public void Start()
        {
            _control.Start();
            _egress.Start();
            _ingress.Start();
        }

        public void Dispose()
        {
            _control.Stop();
            _requests.Stop();
            _egress.Stop();
            _ingress.Stop();
            _control.Dispose();
            _requests.Dispose();
            _egress.Dispose();
            _ingress.Dispose();
        }

        public bool TryGetBodyPose(out Received<BodyPose> newest)
        {
            return _receiver.BodyPose.TryGet(out newest);
        }

        public bool TryGetIkTargets(out Received<IkTargets> newest)
        {
            return _receiver.IkTargets.TryGet(out newest);
        }

        public bool TryGetGaitState(out Received<GaitState> newest)
        {
            return _receiver.GaitState.TryGet(out newest);
        }

        /// <summary>The next gait event, each of them once.</summary>
        public bool TryTakeGaitEvent(out Received<GaitEvent> next)
        {
            return _receiver.GaitEvents.TryTake(out next);
        }

        /// <summary>The next message of the other streams: `calibration`, `sys/session`, what else was asked for.</summary>
        public bool TryTakeMessage(out Message next)
        {
            return _receiver.Others.TryTake(out next);
        }

        /// <summary>The last refusal of the last second, or null.</summary>
        public RefusalReport TakeRefusal()
        {
            return _receiver.TakeReport();
        }

        /// <summary>
        /// Publishes `head/pose`, true at `ownNs` of <see cref="OwnClock"/>. Without the bus clock it is sent as not
        /// valid.
        /// </summary>
        public PublishResult PublishHead(HeadPose head, long ownNs, bool valid)
        {
            long offset, now = OwnClock.NowNs;
            _time.TryGetOffset(out offset);
            return _ingress.Publish(ref head, ownNs + offset, now + offset, valid && _time.IsFresh(now));
        }

        /// <summary>
        /// Asks the service (SPEC, section 7), as in Request("calibrate/floor", null, 60000). Arguments are numbers,
        /// strings, bools and null; throws ArgumentException for others.
        /// </summary>
        public ControlRequest Request(
            string command, IDictionary<string, object> arguments = null, int timeoutMs = 2000)
        {
            return _requests.Ask(command, arguments, timeoutMs);
        }

        /// <summary>The bus clock at an instant of <see cref="OwnClock"/>; false while it is not known.</summary>
        public bool TryGetBusTime(long ownNs, out long busNs)
        {
            long offset;
            bool known = _time.TryGetOffset(out offset);
            busNs = ownNs + offset;
            return known;
        }

        /// <summary>Seconds since a message was true; since it came, while the bus clock is not known.</summary>
        public double AgeSeconds(Envelope envelope, long arrivalNs)
        {
            long bus, now = OwnClock.NowNs;
            return (TryGetBusTime(now, out bus) ? bus - envelope.T : now - arrivalNs) * 1e-9;
        }

        /// <summary>All counters, now.</summary>
        public ConnectionStatistics Statistics()
        {
            var links = new Link[] { _egress, _ingress, _control, _requests };
            var made = new ConnectionStatistics
            {
                Welcomes = _egress.Welcomes,
                Session = _control.Session,
                BadAnswers = _control.BadAnswers,
                UncertaintyNs = _time.Uncertainty(OwnClock.NowNs),
                Sent = _ingress.Sent,
                UnsentNoBus = _ingress.CountOf(PublishResult.NoBus),
                UnsentFull = _ingress.CountOf(PublishResult.Full),
                UnsentInvalid = _ingress.CountOf(PublishResult.Invalid),
                UnsentCutOff = _ingress.CutOff,
                Overflow = _receiver.GaitEvents.Lost + _receiver.Others.Lost,
                Unread = TopicStatistics.Of(_receiver.Unread),
            };
            foreach (Link link in links)
            {
                made.Connections += link.Connections;
                made.Violations += link.Violations;
                made.Stalls += link.Stalls;
                made.Failures += link.Failures;
            }
            foreach (StreamTopic topic in _receiver.Topics())
            {
                made.Topics[topic.Name] = TopicStatistics.Of(topic.Counters);
            }
            return made;
        }
    }
}
