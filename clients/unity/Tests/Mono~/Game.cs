using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Threading;
using UnityEngine;
using UnityEngine.XR;

namespace Foottrack.Tests
{
    /// <summary>
    /// A game with a client, a head publisher and an avatar, at about 100 frames a second, that tells the test what it
    /// sees. The gait event "stop" with the step <see cref="Final"/> ends it.
    /// </summary>
    internal sealed class Game
    {
        public const long Final = 424242;
        private const int FrameMs = 10;
        private const int FramesPerLine = 10;

        private readonly List<long> _steps = new List<long>();
        private readonly List<long> _poses = new List<long>();
        private readonly Stopwatch _clock = Stopwatch.StartNew();
        private readonly FoottrackClient _client;
        private readonly FoottrackBody _body;
        private readonly Animator _animator;
        private readonly FoottrackHeadPublisher _publisher;
        private double _longestFrameMs;
        private bool _over;

        private Game(int ingress, int egress, int control, FollowMode follow)
        {
            _client = new GameObject("foottrack").AddComponent<FoottrackClient>();
            _client.ingressPort = ingress;
            _client.egressPort = egress;
            _client.controlPort = control;
            _client.Connected += () => Say("connected", "at", _clock.ElapsedMilliseconds);
            _client.Disconnected += why => Say("disconnected", "why", why);
            _client.Refused += refusal => Say("refused", "report", refusal);
            _client.GaitEventReceived += OnGaitEvent;

            var head = new GameObject("camera");
            head.transform.position = new Vector3(0.25f, 1.5f, 0.5f);
            // A quarter turn to the left in Unity's left-handed axes.
            head.transform.rotation = new Quaternion(0f, -Mathf.Sqrt(0.5f), 0f, Mathf.Sqrt(0.5f));
            InputDevices.Headset = new InputDevice { isValid = true, Tracked = true };
            _publisher = head.AddComponent<FoottrackHeadPublisher>();
            _publisher.client = _client;
            _publisher.head = head.transform;

            var avatar = new GameObject("avatar");
            _animator = avatar.AddComponent<Animator>();
            Leg(-0.1f, HumanBodyBones.LeftUpperLeg, HumanBodyBones.LeftLowerLeg, HumanBodyBones.LeftFoot);
            Leg(0.1f, HumanBodyBones.RightUpperLeg, HumanBodyBones.RightLowerLeg, HumanBodyBones.RightFoot);
            _body = avatar.AddComponent<FoottrackBody>();
            _body.client = _client;
            _body.follow = follow;
        }

        /// <summary>Arguments: "game", the ports of ingress, egress and control, "Tracked" or "WalkInPlace".</summary>
        public static int Run(string[] arguments)
        {
            var game = new Game(
                int.Parse(arguments[1]),
                int.Parse(arguments[2]),
                int.Parse(arguments[3]),
                (FollowMode)Enum.Parse(typeof(FollowMode), arguments[4]));
            game.Play();
            return 0;
        }

        private void Play()
        {
            var behaviours = new Behaviour[] { _client, _body, _publisher };
            Scene.Begin(behaviours);
            for (int frame = 1; !_over; frame++)
            {
                double began = _clock.Elapsed.TotalMilliseconds;
                Scene.Frame(FrameMs * 1e-3f, behaviours);
                if (_over)
                {
                    break;
                }
                TakePose();
                _longestFrameMs = Math.Max(_longestFrameMs, _clock.Elapsed.TotalMilliseconds - began);
                if (frame % FramesPerLine == 0)
                {
                    SayFrames();
                }
                Thread.Sleep(FrameMs);
            }
            double disabling = _clock.Elapsed.TotalMilliseconds;
            _client.enabled = false;
            Say("ended", "disable_ms", _clock.Elapsed.TotalMilliseconds - disabling);
        }

        private void Leg(float x, HumanBodyBones upper, HumanBodyBones lower, HumanBodyBones foot)
        {
            _animator.AddBone(upper, new Vector3(x, 1.0f, 0f));
            _animator.AddBone(lower, new Vector3(x, 0.5f, 0f));
            _animator.AddBone(foot, new Vector3(x, 0.1f, 0f));
        }

        private void TakePose()
        {
            Received<BodyPose> newest;
            if (_client.TryGetBodyPose(out newest)
                && (_poses.Count == 0 || _poses[_poses.Count - 1] != newest.Envelope.Seq))
            {
                _poses.Add(newest.Envelope.Seq);
            }
        }

        private void SayFrames()
        {
            Transform root = _body.transform;
            Vector3 hips = (_animator.GetBoneTransform(HumanBodyBones.LeftUpperLeg).position
                + _animator.GetBoneTransform(HumanBodyBones.RightUpperLeg).position) * 0.5f;
            Program.Say(new Dictionary<string, object>
            {
                { "kind", "frames" },
                { "statistics", _client.Connection.Statistics() },
                { "synchronised", _client.Connection.IsSynchronised },
                { "longest_frame_ms", _longestFrameMs },
                { "origin", _publisher.Origin },
                { "root", Numbers(root.position) },
                { "forward", Numbers(root.forward) },
                { "scale", root.localScale.y },
                { "hips", Numbers(hips) },
                { "left", Numbers(_animator.Goals[0].Position) },
                { "left_toes", Numbers(_animator.Goals[0].Rotation * Vector3.forward) },
                { "left_weight", _animator.Goals[0].PositionWeight },
                { "right", Numbers(_animator.Goals[1].Position) },
            });
            _longestFrameMs = 0.0;
        }

        private void OnGaitEvent(Received<GaitEvent> gait)
        {
            if (gait.Body.Event == GaitEventKind.Stop && gait.Body.Step == Final)
            {
                Program.Say(new Dictionary<string, object>
                {
                    { "kind", "final" },
                    { "steps", _steps },
                    { "poses", _poses },
                    { "statistics", _client.Connection.Statistics() },
                });
                _over = true;
            }
            else
            {
                _steps.Add(gait.Body.Step);
            }
        }

        private static float[] Numbers(Vector3 v)
        {
            return new[] { v.x, v.y, v.z };
        }

        private static void Say(string kind, string key, object value)
        {
            Program.Say(new Dictionary<string, object> { { "kind", kind }, { key, value } });
        }
    }
}
