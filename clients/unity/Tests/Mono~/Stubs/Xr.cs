using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public static class SubsystemManager
    {
        public static readonly List<XR.XRInputSubsystem> Running = new List<XR.XRInputSubsystem>();

        public static void GetSubsystems<T>(List<T> found)
        {
            found.Clear();
            foreach (object subsystem in Running)
            {
                found.Add((T)subsystem);
            }
        }
    }
}

namespace UnityEngine.XR
{
    public enum XRNode
    {
        Head,
    }

    public struct InputFeatureUsage<T>
    {
    }

    public static class CommonUsages
    {
        public static readonly InputFeatureUsage<bool> isTracked = new InputFeatureUsage<bool>();
    }

    public struct InputDevice
    {
        public bool isValid { get; set; }
        public bool Tracked;

        public bool TryGetFeatureValue(InputFeatureUsage<bool> usage, out bool value)
        {
            value = Tracked;
            return isValid;
        }
    }

    public static class InputDevices
    {
        public static InputDevice Headset;

        public static InputDevice GetDeviceAtXRNode(XRNode node) { return Headset; }
    }

    public sealed class XRInputSubsystem
    {
        public event Action<XRInputSubsystem> trackingOriginUpdated;

        public void Recentre()
        {
            if (trackingOriginUpdated != null)
            {
                trackingOriginUpdated(this);
            }
        }
    }
}
