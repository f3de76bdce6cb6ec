using System;

namespace Foottrack
{
    /// <summary>The measurements' bodies (SPEC, section 6).</summary>
    internal static class MeasurementReader
    {
        /// <summary>Of a principal minor of a covariance scaled to a largest element of 1.</summary>
        private const double SemidefiniteTolerance = 1e-9;

        public static Imu Imu(MsgpackReader r)
        {
            var body = new Imu();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Acc)) { body.Acc = r.ReadVec3(); seen |= 1; }
                else if (r.KeyIs(Names.Gyro)) { body.Gyro = Optional.Vec3(r); }
                else if (r.KeyIs(Names.Q)) { body.Q = Optional.Quat(r); }
                else if (r.KeyIs(Names.TDev)) { body.TDev = Optional.Int(r); }
                else if (r.KeyIs(Names.TArr)) { body.TArr = r.ReadInt(); seen |= 2; }
                else if (r.KeyIs(Names.Accuracy)) { body.Accuracy = Optional.Int(r); }
                else { r.Skip(); }
            }
            r.Require(seen == 3 && (body.Gyro.HasValue || body.Q.HasValue));
            r.Require(!body.Accuracy.HasValue || (body.Accuracy.Value >= 0 && body.Accuracy.Value <= 3));
            return body;
        }

        public static Optical Optical(MsgpackReader r)
        {
            var body = new Optical();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.P)) { body.P = r.ReadVec3(); seen |= 1; }
                else if (r.KeyIs(Names.Q)) { body.Q = Optional.Quat(r); }
                else if (r.KeyIs(Names.QAlt)) { body.QAlt = Optional.Quat(r); }
                else if (r.KeyIs(Names.Cov)) { body.Cov = Covariance(r); seen |= 2; }
                else if (r.KeyIs(Names.SizeRatio)) { body.SizeRatio = Optional.NotNegative(r); }
                else if (r.KeyIs(Names.ReprojPx)) { body.ReprojPx = Optional.NotNegative(r); }
                else if (r.KeyIs(Names.EdgePx)) { body.EdgePx = r.ReadFloat(); seen |= 4; }
                else if (r.KeyIs(Names.Frame)) { body.Frame = r.ReadInt(); seen |= 8; }
                else { r.Skip(); }
            }
            r.Require(seen == 15);
            return body;
        }

        public static HeadPose HeadPose(MsgpackReader r)
        {
            var body = new HeadPose();
            int seen = 0;
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.P)) { body.P = Optional.Vec3(r); }
                else if (r.KeyIs(Names.Q)) { body.Q = Optional.Quat(r); }
                else if (r.KeyIs(Names.Tracked)) { body.Tracked = r.ReadBool(); seen |= 1; }
                else if (r.KeyIs(Names.Origin)) { body.Origin = Optional.Int(r) ?? 0; }
                else if (r.KeyIs(Names.Moved)) { body.Moved = ResultReader.OptionalPose(r); }
                else { r.Skip(); }
            }
            r.Require(seen == 1 && (!body.Tracked || (body.P.HasValue && body.Q.HasValue)));
            return body;
        }

        public static Truth Truth(MsgpackReader r)
        {
            RigidPose pose = ResultReader.Pose(r);
            return new Truth { P = pose.P, Q = pose.Q };
        }

        public static CameraPreview CameraPreview(MsgpackReader r)
        {
            var body = new CameraPreview();
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                if (r.KeyIs(Names.Jpeg)) { body.Jpeg = r.ReadBytes(); }
                else { r.Skip(); }
            }
            r.Require(body.Jpeg != null);
            return body;
        }

        private static Covariance Covariance(MsgpackReader r)
        {
            r.Require(r.EnterArray() == 6);
            var c = new Covariance
            {
                Xx = r.ReadFloat(),
                Xy = r.ReadFloat(),
                Xz = r.ReadFloat(),
                Yy = r.ReadFloat(),
                Yz = r.ReadFloat(),
                Zz = r.ReadFloat(),
            };
            r.Require(IsSemidefinite(c));
            return c;
        }

        private static bool IsSemidefinite(Covariance c)
        {
            double scale = Math.Max(Math.Max(Math.Abs(c.Xx), Math.Abs(c.Yy)), Math.Abs(c.Zz));
            scale = Math.Max(Math.Max(scale, Math.Abs(c.Xy)), Math.Max(Math.Abs(c.Xz), Math.Abs(c.Yz)));
            if (scale <= 0.0)
            {
                return true;
            }
            double xx = c.Xx / scale, xy = c.Xy / scale, xz = c.Xz / scale;
            double yy = c.Yy / scale, yz = c.Yz / scale, zz = c.Zz / scale;
            double ofX = yy * zz - yz * yz, ofY = xx * zz - xz * xz, ofZ = xx * yy - xy * xy;
            double determinant = xx * ofX - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
            double least = Math.Min(Math.Min(ofX, ofY), Math.Min(ofZ, determinant));
            return xx >= 0.0 && yy >= 0.0 && zz >= 0.0 && least >= -SemidefiniteTolerance;
        }
    }
}
