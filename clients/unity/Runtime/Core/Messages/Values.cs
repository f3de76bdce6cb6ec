namespace Foottrack
{
    /// <summary>Three numbers in the wire's axes: +X right, +Y up, -Z forward.</summary>
    public struct Vec3
    {
        public double X, Y, Z;

        public Vec3(double x, double y, double z)
        {
            X = x;
            Y = y;
            Z = z;
        }
    }

    /// <summary>A rotation [x, y, z, w], body to parent, in the wire's axes.</summary>
    public struct Quat
    {
        public double X, Y, Z, W;

        public Quat(double x, double y, double z, double w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }
    }

    /// <summary>Position (m) and rotation of a body in its parent, in the wire's axes.</summary>
    public struct RigidPose
    {
        public Vec3 P;
        public Quat Q;

        public RigidPose(Vec3 p, Quat q)
        {
            P = p;
            Q = q;
        }
    }

    /// <summary>Which foot.</summary>
    public enum Side
    {
        Left,
        Right,
    }
}
