using System;
using System.Collections.Generic;
using System.Reflection;

namespace UnityEngine
{
    // As much of the engine as the thin layer asks for. A scene is what a test puts together, and a frame is what
    // Scene.Frame calls.
    public class Object
    {
    }

    public class Component : Object
    {
        public GameObject gameObject { get; internal set; }
        public Transform transform { get { return gameObject.transform; } }

        public T GetComponent<T>() where T : Component { return gameObject.GetComponent<T>(); }
    }

    public class Behaviour : Component
    {
        private bool _enabled = true;

        public bool enabled
        {
            get { return _enabled; }
            set
            {
                bool was = _enabled;
                _enabled = value;
                if (was != value)
                {
                    Scene.Send(this, value ? "OnEnable" : "OnDisable", true);
                }
            }
        }
    }

    public class MonoBehaviour : Behaviour
    {
    }

    public sealed class GameObject : Object
    {
        private readonly List<Component> _components = new List<Component>();

        public GameObject(string name)
        {
            this.name = name;
            transform = new Transform();
            transform.gameObject = this;
        }

        public string name { get; set; }
        public Transform transform { get; private set; }
        public bool activeSelf { get; private set; }

        public void SetActive(bool value) { activeSelf = value; }

        public static GameObject CreatePrimitive(PrimitiveType type) { return new GameObject(type.ToString()); }

        public T AddComponent<T>() where T : Component, new()
        {
            var made = new T { gameObject = this };
            _components.Add(made);
            return made;
        }

        public T GetComponent<T>() where T : Component
        {
            return (T)_components.Find(component => component is T);
        }
    }

    public enum PrimitiveType
    {
        Sphere,
    }

    /// <summary>Without rotation or scale that differs by axis in its parents: those are all that the tests need.</summary>
    public sealed class Transform : Component
    {
        public Transform parent;
        private Vector3 _localPosition;
        private Quaternion _localRotation = Quaternion.identity;
        public Vector3 localScale = Vector3.one;

        public Quaternion rotation
        {
            get { return parent == null ? _localRotation : parent.rotation * _localRotation; }
            set { _localRotation = parent == null ? value : Quaternion.Inverse(parent.rotation) * value; }
        }

        public Vector3 position
        {
            get { return parent == null ? _localPosition : parent.TransformPoint(_localPosition); }
            set { _localPosition = parent == null ? value : parent.InverseTransformPoint(value); }
        }

        public Vector3 lossyScale { get { return parent == null ? localScale : localScale * parent.lossyScale.y; } }
        public Vector3 forward { get { return rotation * Vector3.forward; } }

        public Vector3 TransformPoint(Vector3 v) { return position + TransformVector(v); }
        public Vector3 TransformVector(Vector3 v) { return rotation * (v * lossyScale.y); }

        public Vector3 InverseTransformPoint(Vector3 v)
        {
            return Quaternion.Inverse(rotation) * (v - position) / lossyScale.y;
        }
    }

    public static class Time
    {
        public static float deltaTime { get; internal set; }
        public static int frameCount { get; internal set; }
    }

    public static class Debug
    {
        public static readonly List<string> Said = new List<string>();

        public static void Log(object message) { Said.Add("log " + message); }
        public static void LogWarning(object message, Object context) { Said.Add("warning " + message); }
        public static void LogError(object message, Object context) { Said.Add("error " + message); }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class DefaultExecutionOrder : Attribute
    {
        public readonly int order;

        public DefaultExecutionOrder(int order) { this.order = order; }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class AddComponentMenu : Attribute
    {
        public AddComponentMenu(string menuName) { }
    }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string tooltip) { }
    }

    /// <summary>What the engine does with behaviours.</summary>
    public static class Scene
    {
        /// <summary>Calls an event function, which Unity finds by its name. Says whether there is one.</summary>
        public static bool Send(Behaviour to, string function, bool evenDisabled = false, params object[] arguments)
        {
            MethodInfo found = to.GetType().GetMethod(function, BindingFlags.Instance | BindingFlags.NonPublic);
            if (found != null && (to.enabled || evenDisabled))
            {
                found.Invoke(to, arguments);
            }
            return found != null;
        }

        public static void Begin(params Behaviour[] behaviours)
        {
            foreach (Behaviour behaviour in behaviours)
            {
                Send(behaviour, "Awake");
                Send(behaviour, "OnEnable");
            }
        }

        /// <summary>A frame: Update, the animator, OnAnimatorIK, LateUpdate. Behaviours are in their order.</summary>
        public static void Frame(float seconds, params Behaviour[] behaviours)
        {
            Time.deltaTime = seconds;
            Time.frameCount++;
            foreach (Behaviour behaviour in behaviours)
            {
                Send(behaviour, "Update");
            }
            foreach (Behaviour behaviour in behaviours)
            {
                var animator = behaviour.GetComponent<Animator>();
                if (animator != null)
                {
                    animator.Animate();
                    Send(behaviour, "OnAnimatorIK", false, 0);
                    animator.Solve();
                }
            }
            foreach (Behaviour behaviour in behaviours)
            {
                Send(behaviour, "LateUpdate");
            }
        }
    }
}
