using System;
using System.Collections.Generic;

namespace Foottrack
{
    /// <summary>The bodies of the system's own streams (SPEC, section 6): once a second, so these may allocate.</summary>
    internal static class SystemReader
    {
        public static Session Session(MsgpackReader r)
        {
            var body = new Session();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Session)) { body.Id = r.ReadText(); seen |= 1; }
                else if (r.KeyIs(Names.Protocol)) { body.Protocol = Version(r); seen |= 2; }
                else if (r.KeyIs(Names.Clock)) { body.Clock = Clock(r); seen |= 4; }
                else if (r.KeyIs(Names.Users)) { body.Users = Users(r); seen |= 8; }
                else if (r.KeyIs(Names.ConfigHash)) { body.ConfigHash = r.ReadText(); seen |= 16; }
                else { r.Skip(); }
            }
            r.Require(seen == 31);
            return body;
        }

        public static Health Health(MsgpackReader r)
        {
            var body = new Health
            {
                Topics = new Dictionary<string, TopicHealth>(),
                Filters = new Dictionary<string, FilterHealth>(),
                Nodes = new Dictionary<string, NodeHealth>(),
                Drops = new Dictionary<string, long>(),
            };
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Topics)) { body.Topics = Named(r, Topic); }
                else if (r.KeyIs(Names.Filters)) { body.Filters = Named(r, Filter); }
                else if (r.KeyIs(Names.Nodes)) { body.Nodes = Named(r, Node); }
                else if (r.KeyIs(Names.Drops)) { body.Drops = Counts(r); }
                else if (r.KeyIs(Names.LatencyMs)) { body.LatencyMs = r.ReadNil() ? (Latency?)null : Latency(r); }
                else { r.Skip(); }
            }
            return body;
        }

        public static LogRecord LogRecord(MsgpackReader r)
        {
            var body = new LogRecord();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Level)) { body.Level = (LogLevel)r.ReadName(Names.LogLevels); seen |= 1; }
                else if (r.KeyIs(Names.Logger)) { body.Logger = r.ReadText(); seen |= 2; }
                else if (r.KeyIs(Names.Text)) { body.Message = r.ReadText(); seen |= 4; }
                else { r.Skip(); }
            }
            r.Require(seen == 7);
            return body;
        }

        private static ProtocolVersion Version(MsgpackReader r)
        {
            var body = new ProtocolVersion();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Major)) { body.Major = r.ReadCount(); seen |= 1; }
                else if (r.KeyIs(Names.Minor)) { body.Minor = r.ReadCount(); seen |= 2; }
                else { r.Skip(); }
            }
            r.Require(seen == 3);
            return body;
        }

        private static ClockAnchor Clock(MsgpackReader r)
        {
            var body = new ClockAnchor();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Bus)) { body.Bus = r.ReadInt(); seen |= 1; }
                else if (r.KeyIs(Names.Unix)) { body.Unix = r.ReadInt(); seen |= 2; }
                else { r.Skip(); }
            }
            r.Require(seen == 3);
            return body;
        }

        private static string[] Users(MsgpackReader r)
        {
            var users = new string[r.EnterArray()];
            for (int i = 0; i < users.Length; i++)
            {
                users[i] = r.ReadText();
                r.Require(StreamTopic.IsUser(users[i]));
            }
            return users;
        }

        private static TopicHealth Topic(MsgpackReader r)
        {
            var body = new TopicHealth { Drops = new Dictionary<string, long>() };
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Hz)) { body.Hz = r.ReadNotNegative(); seen |= 1; }
                else if (r.KeyIs(Names.Messages)) { body.Messages = r.ReadCount(); seen |= 2; }
                else if (r.KeyIs(Names.Gaps)) { body.Gaps = r.ReadCount(); seen |= 4; }
                else if (r.KeyIs(Names.Drops)) { body.Drops = Counts(r); }
                else if (r.KeyIs(Names.Age)) { body.Age = Optional.NotNegative(r); }
                else { r.Skip(); }
            }
            r.Require(seen == 7);
            return body;
        }

        private static FilterHealth Filter(MsgpackReader r)
        {
            var none = new Dictionary<string, long>();
            var body = new FilterHealth { Accepted = none, Rejected = none };
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Accepted)) { body.Accepted = Counts(r); }
                else if (r.KeyIs(Names.Rejected)) { body.Rejected = Counts(r); }
                else { r.Skip(); }
            }
            return body;
        }

        private static NodeHealth Node(MsgpackReader r)
        {
            var body = new NodeHealth();
            bool seen = false;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.State)) { body.State = (NodeState)r.ReadName(Names.NodeStates); seen = true; }
                else if (r.KeyIs(Names.Restarts)) { body.Restarts = r.ReadCount(); }
                else if (r.KeyIs(Names.Error)) { body.Error = r.ReadNil() ? null : r.ReadText(); }
                else { r.Skip(); }
            }
            r.Require(seen);
            return body;
        }

        private static Latency Latency(MsgpackReader r)
        {
            var body = new Latency();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.P50)) { body.P50 = r.ReadNotNegative(); seen |= 1; }
                else if (r.KeyIs(Names.P99)) { body.P99 = r.ReadNotNegative(); seen |= 2; }
                else { r.Skip(); }
            }
            r.Require(seen == 3);
            return body;
        }

        private static Dictionary<string, long> Counts(MsgpackReader r)
        {
            return Named(r, reader => reader.ReadCount());
        }

        private static Dictionary<string, T> Named<T>(MsgpackReader r, Func<MsgpackReader, T> read)
        {
            var found = new Dictionary<string, T>();
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                string key = r.KeyText();
                found[key] = read(r);
            }
            return found;
        }
    }
}
