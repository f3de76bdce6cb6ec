namespace Foottrack
{
    /// <summary>
    /// Two frames to a message. Total: any bytes give a message or the reason why they are none. The results' streams
    /// are decoded without allocating; each has its own place here, valid until the next message.
    /// </summary>
    internal sealed class MessageDecoder
    {
        public const int MaxPayloadBytes = 256 * 1024;
        public const int ProtocolMajor = 1;
        public const int MostTopics = 1024;

        private readonly MsgpackReader _reader = new MsgpackReader();
        private readonly StringCache _names = new StringCache();
        private readonly ByteTable<StreamTopic> _topics = new ByteTable<StreamTopic>(MostTopics);

        /// <summary>Of the last message; null when it could not be read.</summary>
        public StreamTopic Topic { get; private set; }

        /// <summary>Which the last message that says one was written for.</summary>
        public long Major { get; private set; }

        public Envelope Envelope { get; private set; }

        public BodyPose BodyPose;
        public IkTargets IkTargets;
        public GaitState GaitState;
        public GaitEvent GaitEvent;

        /// <summary>The body of any other stream.</summary>
        public object Body { get; private set; }

        public Refusal Decode(FrameBuffer frames)
        {
            Topic = null;
            if (frames.Count != 2)
            {
                return Refusal.Frames;
            }
            Topic = FindTopic(frames);
            if (Topic == null)
            {
                return Refusal.Topic;
            }
            if (frames.Length(1) > MaxPayloadBytes)
            {
                return Refusal.Oversized;
            }
            _reader.Load(frames.Bytes, frames.Offset(1), frames.Length(1));
            int data = ReadEnvelope();
            if (_reader.Fault == Refusal.None)
            {
                _reader.Position = data;
                _reader.Mistake = Refusal.Body;
                ReadBody();
            }
            return _reader.Fault;
        }

        private StreamTopic FindTopic(FrameBuffer frames)
        {
            int offset = frames.Offset(0), length = frames.Length(0);
            if (length > StreamTopic.MaxBytes)
            {
                return null;
            }
            StreamTopic topic = _topics.Find(frames.Bytes, offset, length);
            if (topic == null)
            {
                topic = StreamTopic.Parse(frames.Bytes, offset, length);
                if (topic != null)
                {
                    // A producer that makes up more users than this is not counted by topic.
                    _topics.TryAdd(frames.Bytes, offset, length, topic);
                }
            }
            return topic;
        }

        /// <summary>Offset of the body.</summary>
        private int ReadEnvelope()
        {
            var envelope = new Envelope();
            int seen = 0, data = 0;
            _reader.Mistake = Refusal.Envelope;
            int start = _reader.Position;
            CheckVersion();
            _reader.Position = start;
            for (int left = _reader.EnterMap(); left > 0; left--)
            {
                _reader.ReadKey();
                if (_reader.KeyIs(Names.Src)) { envelope.Src = _reader.ReadText(_names); seen |= 1; }
                else if (_reader.KeyIs(Names.Sid)) { envelope.Sid = _reader.ReadText(_names); seen |= 2; }
                else if (_reader.KeyIs(Names.Seq)) { envelope.Seq = _reader.ReadCount(); seen |= 4; }
                else if (_reader.KeyIs(Names.T)) { envelope.T = _reader.ReadInt(); seen |= 8; }
                else if (_reader.KeyIs(Names.TPub)) { envelope.TPub = _reader.ReadInt(); seen |= 16; }
                else if (_reader.KeyIs(Names.Valid)) { envelope.Valid = _reader.ReadBool(); seen |= 32; }
                else if (_reader.KeyIs(Names.Data)) { data = _reader.Position; seen |= 64; _reader.Skip(); }
                else { _reader.Skip(); }
            }
            _reader.Require(seen == 127);
            Envelope = envelope;
            return data;
        }

        /// <summary>First of all: nothing else that another major says can be judged. It usually comes first, too.</summary>
        private void CheckVersion()
        {
            for (int left = _reader.EnterMap(); left > 0; left--)
            {
                _reader.ReadKey();
                if (_reader.KeyIs(Names.V))
                {
                    Major = _reader.ReadAnyInt();
                    if (Major != ProtocolMajor)
                    {
                        _reader.Refuse(Refusal.Version);
                    }
                    return;
                }
                _reader.Skip();
            }
            _reader.Refuse(Refusal.Envelope);
        }

        private void ReadBody()
        {
            Body = null;
            switch (Topic.Kind)
            {
                case StreamKind.BodyPose: BodyPose = ResultReader.BodyPose(_reader); break;
                case StreamKind.IkTargets: IkTargets = ResultReader.IkTargets(_reader); break;
                case StreamKind.GaitState: GaitState = ResultReader.GaitState(_reader); break;
                case StreamKind.GaitEvent: GaitEvent = ResultReader.GaitEvent(_reader); break;
                default: Body = ReadOther(); break;
            }
        }

        private object ReadOther()
        {
            switch (Topic.Kind)
            {
                case StreamKind.ImuLeft:
                case StreamKind.ImuRight: return MeasurementReader.Imu(_reader);
                case StreamKind.HeadPose: return MeasurementReader.HeadPose(_reader);
                case StreamKind.TruthLeft:
                case StreamKind.TruthRight: return MeasurementReader.Truth(_reader);
                case StreamKind.Calibration: return CalibrationReader.Calibration(_reader);
                case StreamKind.CameraPreview: return MeasurementReader.CameraPreview(_reader);
                case StreamKind.Session: return SystemReader.Session(_reader);
                case StreamKind.Health: return SystemReader.Health(_reader);
                case StreamKind.Log: return SystemReader.LogRecord(_reader);
                default: return MeasurementReader.Optical(_reader);
            }
        }
    }
}
