using UnityEngine;

namespace Foottrack.Samples
{
    /// <summary>
    /// Put this on an empty object in an empty scene, run `foottrack demo`, and press Play: spheres where ankles, knees
    /// and hips are, and gait events in the console.
    /// </summary>
    public sealed class FeetAndHead : MonoBehaviour
    {
        private FoottrackClient _client;
        private Transform _hips;
        private Transform[] _left;
        private Transform[] _right;

        private void Awake()
        {
            _client = gameObject.AddComponent<FoottrackClient>();
            _client.GaitEventReceived += OnGaitEvent;
            _hips = Sphere("Hips", 0.15f);
            _left = new[] { Sphere("Left ankle", 0.1f), Sphere("Left knee", 0.08f) };
            _right = new[] { Sphere("Right ankle", 0.1f), Sphere("Right knee", 0.08f) };
        }

        private void Update()
        {
            Received<BodyPose> newest;
            if (!_client.TryGetBodyPose(out newest) || !newest.Envelope.Valid)
            {
                return;
            }
            RigidPose? hips = newest.Body.Hips;
            Show(_hips, hips.HasValue ? hips.Value.P : (Vec3?)null);
            Show(_left, newest.Body.Left);
            Show(_right, newest.Body.Right);
        }

        private static void OnGaitEvent(Received<GaitEvent> gait)
        {
            Debug.Log(gait.Body.Side + " " + gait.Body.Event + ", step " + gait.Body.Step);
        }

        private static void Show(Transform[] leg, FootPose? foot)
        {
            bool known = foot.HasValue && foot.Value.Stage != FootStage.Lost;
            Show(leg[0], known ? foot.Value.Ankle.P : (Vec3?)null);
            Show(leg[1], known ? foot.Value.Knee : null);
        }

        private static void Show(Transform sphere, Vec3? at)
        {
            sphere.gameObject.SetActive(at.HasValue);
            if (at.HasValue)
            {
                sphere.position = UnityAxes.ToUnity(at.Value);
            }
        }

        private static Transform Sphere(string name, float size)
        {
            GameObject made = GameObject.CreatePrimitive(PrimitiveType.Sphere);
            made.name = name;
            made.transform.localScale = Vector3.one * size;
            return made.transform;
        }
    }
}
