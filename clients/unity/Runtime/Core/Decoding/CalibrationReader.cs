namespace Foottrack
{
    /// <summary>What calibrations found (SPEC, section 6).</summary>
    internal static class CalibrationReader
    {
        public static Calibration Calibration(MsgpackReader r)
        {
            var body = new Calibration();
            int seen = 0, values = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Kind))
                {
                    body.Kind = (CalibrationKind)r.ReadName(Names.CalibrationKinds);
                    seen |= 1;
                }
                else if (r.KeyIs(Names.Values))
                {
                    // Which values they are may stand behind them.
                    values = r.Position;
                    seen |= 2;
                    r.Skip();
                }
                else { r.Skip(); }
            }
            r.Require(seen == 3);
            int end = r.Position;
            r.Position = values;
            body.Values = Values(r, body.Kind);
            r.Position = end;
            return body;
        }

        private static object Values(MsgpackReader r, CalibrationKind kind)
        {
            switch (kind)
            {
                case CalibrationKind.Body: return Body(r);
                case CalibrationKind.Floor: return Floor(r);
                case CalibrationKind.Heading: return Heading(r);
                case CalibrationKind.Imu: return Imu(r);
                default: return Mount(r);
            }
        }

        private static BodyValues Body(MsgpackReader r)
        {
            var body = new BodyValues();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Height)) { body.Height = r.ReadNotNegative(); seen |= 1; }
                else if (r.KeyIs(Names.Thigh)) { body.Thigh = r.ReadNotNegative(); seen |= 2; }
                else if (r.KeyIs(Names.Shank)) { body.Shank = r.ReadNotNegative(); seen |= 4; }
                else if (r.KeyIs(Names.Torso)) { body.Torso = r.ReadNotNegative(); seen |= 8; }
                else if (r.KeyIs(Names.HipWidth)) { body.HipWidth = r.ReadNotNegative(); seen |= 16; }
                else if (r.KeyIs(Names.HipBack)) { body.HipBack = r.ReadFloat(); seen |= 32; }
                else if (r.KeyIs(Names.NeckDown)) { body.NeckDown = Optional.NotNegative(r); }
                else if (r.KeyIs(Names.NeckBack)) { body.NeckBack = Optional.Float(r); }
                else { r.Skip(); }
            }
            r.Require(seen == 63);
            return body;
        }

        private static FloorValues Floor(MsgpackReader r)
        {
            var body = new FloorValues();
            bool seen = false;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Height)) { body.Height = r.ReadFloat(); seen = true; }
                else { r.Skip(); }
            }
            r.Require(seen);
            return body;
        }

        private static HeadingValues Heading(MsgpackReader r)
        {
            var body = new HeadingValues();
            bool seen = false;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Yaw)) { body.Yaw = r.ReadFloat(); seen = true; }
                else if (r.KeyIs(Names.ImuYaw)) { body.ImuYaw = Yaws(r); }
                else { r.Skip(); }
            }
            r.Require(seen);
            return body;
        }

        private static PerSideYaw Yaws(MsgpackReader r)
        {
            var yaws = new PerSideYaw();
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Left)) { yaws.Left = Optional.Float(r); }
                else if (r.KeyIs(Names.Right)) { yaws.Right = Optional.Float(r); }
                else { r.Skip(); }
            }
            return yaws;
        }

        private static ImuValues Imu(MsgpackReader r)
        {
            var body = new ImuValues();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Side)) { body.Side = (Side)r.ReadName(Names.Sides); seen |= 1; }
                else if (r.KeyIs(Names.AccBias)) { body.AccBias = r.ReadVec3(); seen |= 2; }
                else if (r.KeyIs(Names.GyroBias)) { body.GyroBias = r.ReadVec3(); seen |= 4; }
                else if (r.KeyIs(Names.P)) { body.P = r.ReadVec3(); seen |= 8; }
                else if (r.KeyIs(Names.Q)) { body.Q = r.ReadQuat(); seen |= 16; }
                else { r.Skip(); }
            }
            r.Require(seen == 31);
            return body;
        }

        private static MountValues Mount(MsgpackReader r)
        {
            var body = new MountValues();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.P)) { body.P = r.ReadVec3(); seen |= 1; }
                else if (r.KeyIs(Names.Q)) { body.Q = r.ReadQuat(); seen |= 2; }
                else if (r.KeyIs(Names.SigmaP)) { body.SigmaP = r.ReadNotNegative(); seen |= 4; }
                else if (r.KeyIs(Names.SigmaQ)) { body.SigmaQ = r.ReadNotNegative(); seen |= 8; }
                else if (r.KeyIs(Names.Base)) { body.Base = r.ReadText(); seen |= 16; }
                else { r.Skip(); }
            }
            r.Require(seen == 31);
            return body;
        }
    }
}
