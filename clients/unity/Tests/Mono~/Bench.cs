using System;
using System.Collections.Generic;
using System.Threading;

namespace Foottrack.Tests
{
    /// <summary>
    /// A loop at 60 frames a second that only measures: how late gait events are, decoded and on the main thread, and
    /// how often garbage is collected meanwhile. The event "stop" with the step <see cref="Game.Final"/> ends it.
    /// </summary>
    internal sealed class Bench
    {
        private const int FrameMs = 16;
        private const int FramesPerLine = 15;
        private const int MostMeasured = 500000;

        private readonly FoottrackConnection _connection;
        private readonly bool _talks;
        private readonly double[] _inThreadMs = new double[MostMeasured];
        private readonly double[] _inUpdateMs = new double[MostMeasured];
        private int _measured;
        private int _events;
        private bool _live;
        private int _collections;
        private double _longestFrameMs;
        private bool _over;

        private Bench(string[] arguments)
        {
            _connection = new FoottrackConnection(new ConnectionSettings
            {
                IngressPort = int.Parse(arguments[1]),
                EgressPort = int.Parse(arguments[2]),
                ControlPort = int.Parse(arguments[3]),
            });
            _talks = arguments[4] == "talk";
            // Memory that is used from now on, so that memory that grows is the client's.
            for (int i = 0; i < MostMeasured; i++)
            {
                _inThreadMs[i] = _inUpdateMs[i] = -1.0;
            }
        }

        /// <summary>Arguments: "bench", three ports, "talk" or "quiet": words take memory.</summary>
        public static int Run(string[] arguments)
        {
            var bench = new Bench(arguments);
            bench.Play();
            return 0;
        }

        private void Play()
        {
            _connection.Start();
            while (!(_connection.IsLive && _connection.IsSynchronised))
            {
                Thread.Sleep(FrameMs);
            }
            for (int frame = 1; !_over; frame++)
            {
                long began = OwnClock.NowNs;
                NoticeConnection();
                Received<GaitEvent> gait;
                while (!_over && _connection.TryTakeGaitEvent(out gait))
                {
                    OnGaitEvent(gait);
                }
                _longestFrameMs = Math.Max(_longestFrameMs, (OwnClock.NowNs - began) * 1e-6);
                if (_talks && frame % FramesPerLine == 0 && !_over)
                {
                    Say("frames");
                }
                Thread.Sleep(FrameMs);
            }
            _connection.Dispose();
        }

        private void NoticeConnection()
        {
            bool live = _connection.IsLive;
            if (live && !_live)
            {
                Say("connected");
            }
            _live = live;
        }

        private void OnGaitEvent(Received<GaitEvent> gait)
        {
            if (_events == 0)
            {
                _collections = GC.CollectionCount(0);
            }
            if (gait.Body.Step == Game.Final)
            {
                _over = true;
                Finish();
                return;
            }
            if (gait.Body.Event == GaitEventKind.FirstStep)
            {
                Program.Say(new Dictionary<string, object> { { "kind", "reached" }, { "step", gait.Body.Step } });
                return;
            }
            _events++;
            long now, arrival;
            // After a restart the clock is not known for a moment.
            if (_measured == MostMeasured || !_connection.TryGetBusTime(OwnClock.NowNs, out now)
                || !_connection.TryGetBusTime(gait.ArrivalNs, out arrival))
            {
                return;
            }
            _inThreadMs[_measured] = (arrival - gait.Envelope.TPub) * 1e-6;
            _inUpdateMs[_measured] = (now - gait.Envelope.TPub) * 1e-6;
            _measured++;
        }

        private void Finish()
        {
            int collections = GC.CollectionCount(0) - _collections;
            Program.Say(new Dictionary<string, object>
            {
                { "kind", "final" },
                { "events", _events },
                { "collections", collections },
                { "in_thread_ms", Copy(_inThreadMs) },
                { "in_main_ms", Copy(_inUpdateMs) },
                { "longest_frame_ms", _longestFrameMs },
                { "statistics", _connection.Statistics() },
            });
        }

        private double[] Copy(double[] values)
        {
            var copy = new double[_measured];
            Array.Copy(values, copy, _measured);
            return copy;
        }

        private void Say(string kind)
        {
            Program.Say(new Dictionary<string, object>
            {
                { "kind", kind }, { "statistics", _connection.Statistics() },
            });
        }
    }
}
