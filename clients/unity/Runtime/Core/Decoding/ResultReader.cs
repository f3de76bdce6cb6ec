namespace Foottrack
{
    /// <summary>The results' bodies (SPEC, section 6). Nothing here allocates.</summary>
    internal static class ResultReader
    {
        public static BodyPose BodyPose(MsgpackReader r)
        {
            var body = new BodyPose();
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Head)) { body.Head = OptionalPose(r); }
                else if (r.KeyIs(Names.Hips)) { body.Hips = OptionalPose(r); }
                else if (r.KeyIs(Names.Left)) { body.Left = OptionalFoot(r); }
                else if (r.KeyIs(Names.Right)) { body.Right = OptionalFoot(r); }
                else { r.Skip(); }
            }
            return body;
        }

        public static IkTargets IkTargets(MsgpackReader r)
        {
            var body = new IkTargets();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Mode)) { body.Mode = (IkMode)r.ReadName(Names.IkModes); seen |= 1; }
                else if (r.KeyIs(Names.Left)) { body.Left = IkFoot(r); seen |= 2; }
                else if (r.KeyIs(Names.Right)) { body.Right = IkFoot(r); seen |= 4; }
                else if (r.KeyIs(Names.PelvisDy)) { body.PelvisDy = r.ReadFloat(); seen |= 8; }
                else if (r.KeyIs(Names.Speed)) { body.Speed = r.ReadFloat(); seen |= 16; }
                else if (r.KeyIs(Names.Heading)) { body.Heading = r.ReadDirection(); seen |= 32; }
                else { r.Skip(); }
            }
            r.Require(seen == 63 && body.PelvisDy <= 0.0);
            return body;
        }

        public static GaitState GaitState(MsgpackReader r)
        {
            var body = new GaitState();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Left)) { body.Left = OptionalGait(r); }
                else if (r.KeyIs(Names.Right)) { body.Right = OptionalGait(r); }
                else if (r.KeyIs(Names.Cadence)) { body.Cadence = r.ReadNotNegative(); seen |= 1; }
                else if (r.KeyIs(Names.Speed)) { body.Speed = r.ReadFloat(); seen |= 2; }
                else if (r.KeyIs(Names.Steps)) { body.Steps = r.ReadCount(); seen |= 4; }
                else { r.Skip(); }
            }
            r.Require(seen == 7);
            return body;
        }

        public static GaitEvent GaitEvent(MsgpackReader r)
        {
            var body = new GaitEvent();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Side)) { body.Side = r.ReadNil() ? (Side?)null : (Side)r.ReadName(Names.Sides); }
                else if (r.KeyIs(Names.Event)) { body.Event = (GaitEventKind)r.ReadName(Names.GaitEvents); seen |= 1; }
                else if (r.KeyIs(Names.Step)) { body.Step = r.ReadCount(); seen |= 2; }
                else { r.Skip(); }
            }
            bool ofThePair = body.Event == GaitEventKind.FirstStep || body.Event == GaitEventKind.Stop;
            r.Require(seen == 3 && (body.Side.HasValue || ofThePair));
            return body;
        }

        public static RigidPose? OptionalPose(MsgpackReader r)
        {
            return r.ReadNil() ? (RigidPose?)null : Pose(r);
        }

        public static RigidPose Pose(MsgpackReader r)
        {
            var pose = new RigidPose();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.P)) { pose.P = r.ReadVec3(); seen |= 1; }
                else if (r.KeyIs(Names.Q)) { pose.Q = r.ReadQuat(); seen |= 2; }
                else { r.Skip(); }
            }
            r.Require(seen == 3);
            return pose;
        }

        private static FootPose? OptionalFoot(MsgpackReader r)
        {
            return r.ReadNil() ? (FootPose?)null : Foot(r);
        }

        private static FootPose Foot(MsgpackReader r)
        {
            var foot = new FootPose();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Hip)) { foot.Hip = Optional.Vec3(r); }
                else if (r.KeyIs(Names.Knee)) { foot.Knee = Optional.Vec3(r); }
                else if (r.KeyIs(Names.Ankle)) { foot.Ankle = Pose(r); seen |= 1; }
                else if (r.KeyIs(Names.Toe)) { foot.Toe = r.ReadVec3(); seen |= 2; }
                else if (r.KeyIs(Names.V)) { foot.V = r.ReadVec3(); seen |= 4; }
                else if (r.KeyIs(Names.Contact)) { foot.Contact = r.ReadBool(); seen |= 8; }
                else if (r.KeyIs(Names.Stage)) { foot.Stage = (FootStage)r.ReadName(Names.FootStages); seen |= 16; }
                else if (r.KeyIs(Names.Sigma)) { foot.Sigma = r.ReadNotNegative(); seen |= 32; }
                else if (r.KeyIs(Names.Age)) { foot.Age = Optional.NotNegative(r); }
                else { r.Skip(); }
            }
            r.Require(seen == 63);
            return foot;
        }

        private static IkFoot IkFoot(MsgpackReader r)
        {
            var foot = new IkFoot();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.P)) { foot.P = r.ReadVec3(); seen |= 1; }
                else if (r.KeyIs(Names.Q)) { foot.Q = r.ReadQuat(); seen |= 2; }
                else if (r.KeyIs(Names.Hint)) { foot.Hint = r.ReadVec3(); seen |= 4; }
                else { r.Skip(); }
            }
            r.Require(seen == 7);
            return foot;
        }

        private static FootGait? OptionalGait(MsgpackReader r)
        {
            return r.ReadNil() ? (FootGait?)null : FootGait(r);
        }

        private static FootGait FootGait(MsgpackReader r)
        {
            var foot = new FootGait();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Phase)) { foot.Phase = (GaitPhase)r.ReadName(Names.GaitPhases); seen |= 1; }
                else if (r.KeyIs(Names.Height)) { foot.Height = r.ReadFloat(); seen |= 2; }
                else if (r.KeyIs(Names.Vy)) { foot.Vy = r.ReadFloat(); seen |= 4; }
                else { r.Skip(); }
            }
            r.Require(seen == 7);
            return foot;
        }
    }
}
