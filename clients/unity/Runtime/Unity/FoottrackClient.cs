using System;
using System.Collections.Generic;
using UnityEngine;

namespace Foottrack
{
    /// <summary>
    /// The way to a foottrack service. One in a scene is enough: FoottrackBody and FoottrackHeadPublisher share it. It
    /// connects while it is enabled, and again whenever the service was restarted; it never waits for the network. All
    /// events come in Update, before the bodies that use them.
    /// </summary>
    [DefaultExecutionOrder(-100)]
    [AddComponentMenu("Foottrack/Foottrack Client")]
    public sealed class FoottrackClient : MonoBehaviour
    {
        [Tooltip("The host that runs the service, or a foottrack relay to it.")]
        public string host = "127.0.0.1";
        public int ingressPort = 7701;
        public int egressPort = 7702;
        public int controlPort = 7703;
        [Tooltip("Whose feet: the first part of the topics.")]
        public string user = "user";
        [Tooltip("Beginnings of this user's streams that are wanted.")]
        public string[] streams = { "pose/", "gait/", "calibration" };
        [Tooltip("What this client calls itself in what it publishes.")]
        public string source = "unity";

        private string _fault = "";

        /// <summary>The bus was found (again), and nothing is missed from now on.</summary>
        public event Action Connected;

        /// <summary>The bus was lost; the text is for a person.</summary>
        public event Action<string> Disconnected;

        /// <summary>Each gait event, in order.</summary>
        public event Action<Received<GaitEvent>> GaitEventReceived;

        /// <summary>Each message of the other streams, in order: `calibration`, `sys/session`.</summary>
        public event Action<Message> MessageReceived;

        /// <summary>Something came that was no message; at most once a second.</summary>
        public event Action<RefusalReport> Refused;

        /// <summary>What it is made of; null while it is not enabled.</summary>
        public FoottrackConnection Connection { get; private set; }

        /// <summary>Whether the bus is there, as the events have told it.</summary>
        public bool IsConnected { get; private set; }

        /// <summary>The newest `pose/body`.</summary>
        public bool TryGetBodyPose(out Received<BodyPose> newest)
        {
            newest = new Received<BodyPose>();
            return Connection != null && Connection.TryGetBodyPose(out newest);
        }

        /// <summary>The newest `pose/ik`.</summary>
        public bool TryGetIkTargets(out Received<IkTargets> newest)
        {
            newest = new Received<IkTargets>();
            return Connection != null && Connection.TryGetIkTargets(out newest);
        }

        /// <summary>The newest `gait/state`.</summary>
        public bool TryGetGaitState(out Received<GaitState> newest)
        {
            newest = new Received<GaitState>();
            return Connection != null && Connection.TryGetGaitState(out newest);
        }

        /// <summary>Seconds since a message was true.</summary>
        public float Age<T>(Received<T> message)
        {
            return Connection == null
                ? float.PositiveInfinity
                : (float)Connection.AgeSeconds(message.Envelope, message.ArrivalNs);
        }

        /// <summary>Publishes `head/pose`, in the wire's axes, true at `ownNs` of OwnClock.</summary>
        public PublishResult PublishHead(HeadPose pose, long ownNs)
        {
            return Connection == null ? PublishResult.NoBus : Connection.PublishHead(pose, ownNs, true);
        }

        /// <summary>
        /// Asks the service, as in
        /// <c>var floor = client.Request("calibrate/floor", null, 60f); yield return new WaitUntil(() => floor.IsDone);</c>
        /// Null while it is not enabled.
        /// </summary>
        public ControlRequest Request(
            string command, IDictionary<string, object> arguments = null, float timeoutSeconds = 2f)
        {
            return Connection == null ? null : Connection.Request(command, arguments, (int)(timeoutSeconds * 1000f));
        }

        private void OnEnable()
        {
            try
            {
                Connection = new FoottrackConnection(new ConnectionSettings
                {
                    Host = host,
                    IngressPort = ingressPort,
                    EgressPort = egressPort,
                    ControlPort = controlPort,
                    User = user,
                    Streams = streams,
                    Source = source,
                });
                Connection.Start();
            }
            catch (ArgumentException e)
            {
                Debug.LogError("foottrack: " + e.Message, this);
                enabled = false;
            }
        }

        private void OnDisable()
        {
            if (Connection != null)
            {
                Connection.Dispose();
                Connection = null;
                IsConnected = false;
            }
        }

        private void Update()
        {
            if (Connection == null)
            {
                return;
            }
            NoticeConnection();
            Received<GaitEvent> gait;
            while (Connection != null && Connection.TryTakeGaitEvent(out gait))
            {
                Tell(GaitEventReceived, gait);
            }
            Message other;
            while (Connection != null && Connection.TryTakeMessage(out other))
            {
                Tell(MessageReceived, other);
            }
            RefusalReport refusal = Connection != null ? Connection.TakeRefusal() : null;
            if (refusal != null)
            {
                Debug.LogWarning("foottrack: " + refusal.Text, this);
                Tell(Refused, refusal);
            }
        }

        private void NoticeConnection()
        {
            string fault = Connection.Fault;
            if (fault != _fault && fault.Length > 0)
            {
                Debug.LogWarning("foottrack: " + fault, this);
            }
            _fault = fault;
            bool isNow = Connection.IsLive;
            if (isNow == IsConnected)
            {
                return;
            }
            IsConnected = isNow;
            if (!isNow)
            {
                Tell(Disconnected, fault);
            }
            else if (Connected != null)
            {
                Connected();
            }
        }

        private static void Tell<T>(Action<T> listeners, T what)
        {
            if (listeners != null)
            {
                listeners(what);
            }
        }
    }
}
