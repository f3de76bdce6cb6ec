using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR;

namespace Foottrack
{
    /// <summary>
    /// Tells the service where the headset is, each frame: `head/pose`. Without it the service knows feet, but no hips.
    /// </summary>
    [DefaultExecutionOrder(100)]
    [AddComponentMenu("Foottrack/Foottrack Head Publisher")]
    public sealed class FoottrackHeadPublisher : MonoBehaviour
    {
        private const double NanosecondsPerSecond = 1e9;

        public FoottrackClient client;
        [Tooltip("The XR camera.")]
        public Transform head;
        [Tooltip("What the headset's poses are in: the XR origin's camera offset; empty: the world.")]
        public Transform stage;
        [Tooltip("The camera's pose is predicted for so much later than LateUpdate, s.")]
        public float lead;
        [Tooltip("Off: a camera without a headset counts as tracked, for a desktop.")]
        public bool needsHeadset = true;

        private readonly List<XRInputSubsystem> _watched = new List<XRInputSubsystem>();

        /// <summary>Changes whenever the stage was recentred.</summary>
        public long Origin { get; private set; }

        /// <summary>To be called by a game that moves the stage's content by itself.</summary>
        public void Recentred()
        {
            Origin++;
        }

        private void LateUpdate()
        {
            if (client == null || head == null)
            {
                return;
            }
            if (_watched.Count == 0)
            {
                Watch();
            }
            var pose = new HeadPose { Origin = Origin, Tracked = IsTracked() };
            if (pose.Tracked)
            {
                pose.P = UnityAxes.FromUnity(stage != null ? stage.InverseTransformPoint(head.position) : head.position);
                pose.Q = UnityAxes.FromUnity(
                    stage != null ? Quaternion.Inverse(stage.rotation) * head.rotation : head.rotation);
            }
            client.PublishHead(pose, OwnClock.NowNs + (long)(lead * NanosecondsPerSecond));
        }

        private void OnDisable()
        {
            foreach (XRInputSubsystem subsystem in _watched)
            {
                subsystem.trackingOriginUpdated -= OnOriginUpdated;
            }
            _watched.Clear();
        }

        private void Watch()
        {
            SubsystemManager.GetSubsystems(_watched);
            foreach (XRInputSubsystem subsystem in _watched)
            {
                subsystem.trackingOriginUpdated += OnOriginUpdated;
            }
        }

        private void OnOriginUpdated(XRInputSubsystem subsystem)
        {
            Recentred();
        }

        private bool IsTracked()
        {
            InputDevice device = InputDevices.GetDeviceAtXRNode(XRNode.Head);
            bool tracked;
            return device.isValid
                ? device.TryGetFeatureValue(CommonUsages.isTracked, out tracked) && tracked
                : !needsHeadset;
        }
    }
}
