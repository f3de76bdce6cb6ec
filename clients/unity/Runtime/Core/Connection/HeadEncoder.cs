using System;

namespace Foottrack
{
    /// <summary>`head/pose` as the two frames of a message, headers included, without allocating.</summary>
    internal sealed class HeadEncoder
    {
        private const int MaxNameBytes = 100;
        /// <summary>Keys, numbers and headers: about 230.</summary>
        private const int MaxOtherBytes = 400;

        private readonly MsgpackWriter _writer = new MsgpackWriter();
        private readonly byte[] _topic, _src, _sid;
        private long _seq;

        /// <summary>Throws ArgumentException for names that have no place on the wire.</summary>
        public HeadEncoder(string user, string source, string sid)
        {
            if (!StreamTopic.IsUser(user) || user == "sys")
            {
                throw new ArgumentException("a user's name is [a-z0-9][a-z0-9-]{0,31}, and not '" + user + "'");
            }
            _topic = Utf8.Bytes(user + "/head/pose");
            _src = Utf8.Bytes(source);
            _sid = Utf8.Bytes(sid);
            if (_src.Length > MaxNameBytes)
            {
                throw new ArgumentException("the source's name is longer than " + MaxNameBytes + " bytes");
            }
        }

        public int MaxBytes
        {
            get { return MaxOtherBytes + _topic.Length + _src.Length + _sid.Length; }
        }

        /// <summary>What could not be sent leaves a gap.</summary>
        public void CountLost()
        {
            _seq++;
        }

        /// <summary>Whether a receiver would take it.</summary>
        public static bool IsSendable(ref HeadPose head)
        {
            bool complete = head.P.HasValue && head.Q.HasValue;
            return (complete || !head.Tracked)
                && (!head.P.HasValue || IsFinite(head.P.Value))
                && (!head.Q.HasValue || IsUnit(head.Q.Value))
                && (!head.Moved.HasValue || (IsFinite(head.Moved.Value.P) && IsUnit(head.Moved.Value.Q)));
        }

        /// <summary>Number of bytes written.</summary>
        public int Encode(byte[] bytes, ref HeadPose head, long t, long tPub, bool valid)
        {
            int payload = 2 + _topic.Length + 9;
            _writer.Begin(bytes, payload);
            _writer.Map(8);
            _writer.Text(Names.V);
            _writer.Int(MessageDecoder.ProtocolMajor);
            _writer.Text(Names.Src);
            _writer.Text(_src);
            _writer.Text(Names.Sid);
            _writer.Text(_sid);
            _writer.Text(Names.Seq);
            _writer.Int(_seq++);
            _writer.Text(Names.T);
            _writer.Int(t);
            _writer.Text(Names.TPub);
            _writer.Int(tPub);
            _writer.Text(Names.Valid);
            _writer.Bool(valid);
            _writer.Text(Names.Data);
            Body(ref head);
            bytes[0] = ZmtpConnection.More;
            bytes[1] = (byte)_topic.Length;
            Array.Copy(_topic, 0, bytes, 2, _topic.Length);
            bytes[payload - 9] = ZmtpConnection.Long;
            int length = _writer.Position - payload;
            for (int i = 1; i <= 8; i++)
            {
                bytes[payload - i] = i <= 4 ? (byte)(length >> (8 * (i - 1))) : (byte)0;
            }
            return _writer.Position;
        }

        private void Body(ref HeadPose head)
        {
            _writer.Map(head.Moved.HasValue ? 5 : 4);
            _writer.Text(Names.P);
            if (head.P.HasValue) { _writer.Vec3(head.P.Value); }
            else { _writer.Nil(); }
            _writer.Text(Names.Q);
            if (head.Q.HasValue) { _writer.Quat(head.Q.Value); }
            else { _writer.Nil(); }
            _writer.Text(Names.Tracked);
            _writer.Bool(head.Tracked);
            _writer.Text(Names.Origin);
            _writer.Int(head.Origin);
            if (head.Moved.HasValue)
            {
                _writer.Text(Names.Moved);
                _writer.Map(2);
                _writer.Text(Names.P);
                _writer.Vec3(head.Moved.Value.P);
                _writer.Text(Names.Q);
                _writer.Quat(head.Moved.Value.Q);
            }
        }

        private static bool IsFinite(Vec3 v)
        {
            double sum = Math.Abs(v.X) + Math.Abs(v.Y) + Math.Abs(v.Z);
            return !double.IsNaN(sum) && !double.IsInfinity(sum);
        }

        private static bool IsUnit(Quat q)
        {
            return Math.Abs(Math.Sqrt(q.X * q.X + q.Y * q.Y + q.Z * q.Z + q.W * q.W) - 1.0) <= GeometryReader.UnitTolerance;
        }
    }
}
