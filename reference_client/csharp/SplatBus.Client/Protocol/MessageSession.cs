// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Threading.Tasks;

namespace SplatBus
{
    /// <summary>The server answered a request with an error.</summary>
    public sealed class RefusedException : Exception
    {
        public RefusedException(Error error) : base(error.Code + ": " + error.Message) { Error = error; }

        public Error Error { get; private set; }
    }

    /// <summary>A question to the server; it is answered once, or fails.</summary>
    abstract class Request
    {
        internal string Type, Reply, Capability;
        internal long Id = -1;
        /// <summary>When the wait for its reply ends, in seconds; 0 while it is not sent.</summary>
        internal double Until;
        internal Action<PacketWriter> Members;

        /// <exception cref="ProtocolException">The reply breaks a rule.</exception>
        internal abstract void Answer(JsonValue reply);
        internal abstract void Fail(Exception why);
    }

    sealed class Request<T> : Request
    {
        readonly TaskCompletionSource<T> source = new TaskCompletionSource<T>(TaskCreationOptions.RunContinuationsAsynchronously);
        internal Func<JsonValue, T> Read;

        internal Task<T> Task { get { return source.Task; } }

        internal override void Answer(JsonValue reply) { source.TrySetResult(Read(reply)); }
        internal override void Fail(Exception why) { source.TrySetException(why); }
    }

    /// <summary>What a message on the message channel asks of who owns the connection.</summary>
    public enum MessageStep
    {
        Nothing,
        /// <summary>The server is known, see <see cref="MessageSession.State"/>.</summary>
        Agreed,
        /// <summary><see cref="MessageSession.Telemetry"/> came.</summary>
        Telemetry,
        /// <summary><see cref="MessageSession.Error"/> came, and answers no request.</summary>
        Error,
        /// <summary>Close the connection, for <see cref="MessageSession.Problem"/>.</summary>
        Close,
    }

    /// <summary>One connection to the message channel, without I/O: payloads in, steps and packets out.</summary>
    public sealed class MessageSession
    {
        static readonly string[] Capabilities =
        {
            Capability.Intrinsics, Capability.Objects, Capability.Scene, Capability.Viewport, Capability.Time, Capability.Ping, Capability.Telemetry,
        };

        static readonly string[] ReplyTypes = { "viewport_size", "camera", "scene", "pong" };

        readonly Json json;
        readonly Wishes wishes;
        readonly Queue<Request> asked = new Queue<Request>();
        long nextId = 1;

        /// <param name="json">Reads the payloads; no other session may use it at the time.</param>
        /// <param name="wishes">What is said on this connection; nothing has been yet.</param>
        /// <param name="now">Seconds.</param>
        public MessageSession(ClientOptions options, Json json, Wishes wishes, double now)
        {
            this.json = json;
            this.wishes = wishes;
            wishes.Unsay();
            Negotiation.WriteHello(Out, options, Capabilities);
            // Its reply, or a welcome before it, tells which version the server speaks [NEG-13].
            Send(new Request<ViewportSize> { Type = "get_viewport_size", Reply = "viewport_size", Read = Replies.Size }, now);
        }

        public readonly Outbox Out = new Outbox();
        public ChannelState State { get; private set; } = ChannelState.Greeted;
        public Welcome Welcome { get; private set; }
        public Error Error { get; private set; }
        public Telemetry Telemetry { get; private set; }
        /// <summary>What the server last did wrong, or null; who reads it sets it to null.</summary>
        public string Problem { get; set; }

        /// <summary>When the wait for the oldest reply ends; infinity where none is awaited.</summary>
        internal double Deadline { get { return asked.Count == 0 ? double.PositiveInfinity : asked.Peek().Until; } }

        /// <summary>Say what is wanted, once TCP has taken what was said before: the newest is enough.</summary>
        public void SayWishes()
        {
            if (Out.IsEmpty) wishes.Say(Out, Welcome);
        }

        /// <summary>Send a request; false while it is not known whether the server takes it.</summary>
        internal bool TryAsk(Request request, double now)
        {
            bool isOf10 = request.Capability == null;
            if (State == ChannelState.Greeted) return false;
            if (!isOf10 && !Negotiation.Lists(Welcome, request.Capability))
            {
                request.Fail(new NotSupportedException("the server does not have " + request.Capability));
                return true;
            }
            if (Welcome != null) request.Id = nextId++;
            Send(request, now);
            return true;
        }

        public MessageStep Receive(ArraySegment<byte> payload)
        {
            JsonValue message, type;
            try { message = json.Read(payload); }
            catch (ProtocolException broken) { return Unreadable(broken.Message); }
            if (!message.TryMember("type", out type)) return OnUntyped(message);
            if (type.Is("welcome")) return OnWelcome(message);
            if (type.Is("error")) return OnError(message);
            if (State != ChannelState.Agreed) return MessageStep.Nothing;
            if (type.Is("telemetry")) return OnTelemetry(message);
            foreach (string each in ReplyTypes) if (type.Is(each)) return OnReply(message, each);
            return MessageStep.Nothing;
        }

        /// <summary>The connection is lost: nothing is answered any more.</summary>
        internal void Lost(Exception why)
        {
            while (asked.Count > 0) asked.Dequeue().Fail(why);
        }

        void Send(Request request, double now)
        {
            PacketWriter writer = Out.Begin(request.Type);
            if (request.Members != null) request.Members(writer);
            if (request.Id >= 0)
            {
                writer.Member("id", request.Id);
            }
            Out.Add();
            request.Until = now + Limits.ReplySeconds;
            asked.Enqueue(request);
        }

        MessageStep OnWelcome(JsonValue message)
        {
            if (State != ChannelState.Greeted) return MessageStep.Nothing;
            Welcome welcome;
            try { welcome = Negotiation.ReadWelcome(message); }
            catch (ProtocolException broken)
            {
                Problem = "a welcome whose " + broken.Message;
                return MessageStep.Nothing;
            }
            if (welcome.Version == Negotiation.Former) State = ChannelState.Old;
            else if (welcome.Version != Negotiation.Own) return Close("a welcome to a version that hello did not list [NEG-16]");
            else
            {
                State = ChannelState.Agreed;
                Welcome = welcome;
                wishes.SayMore();
            }
            return MessageStep.Agreed;
        }

        /// <summary>An object without a type is a reply of 1.0, or none at all.</summary>
        MessageStep OnUntyped(JsonValue message)
        {
            JsonValue size;
            if (State == ChannelState.Agreed || asked.Count == 0) return MessageStep.Nothing;
            if (State == ChannelState.Old) return Answer(message);
            if (!message.TryMember("viewport_size", out size)) return MessageStep.Nothing;
            State = ChannelState.Old;
            return Answer(message) == MessageStep.Close ? MessageStep.Close : MessageStep.Agreed;
        }

        MessageStep OnReply(JsonValue message, string type)
        {
            JsonValue member;
            long id = -1;
            if (message.TryMember("id", out member) && !member.TryInteger(out id)) id = -2;
            if (asked.Count == 0) return MessageStep.Nothing;
            if (asked.Peek().Reply != type || asked.Peek().Id != id) return Close("a reply to another request than the oldest [NEG-28]");
            return Answer(message);
        }

        MessageStep Answer(JsonValue message)
        {
            try
            {
                asked.Peek().Answer(message);
                asked.Dequeue();
                return MessageStep.Nothing;
            }
            catch (ProtocolException broken) { return Close("a reply that " + broken.Message); }
        }

        MessageStep OnError(JsonValue message)
        {
            Error = Negotiation.ReadError(message);
            if (asked.Count > 0 && State == ChannelState.Agreed)
            {
                // What was asked before the welcome has no id; only `busy` is about a pose [NEG-29].
                Request oldest = asked.Peek();
                bool isIts = Error.Id.HasValue ? oldest.Id == Error.Id.Value : oldest.Id < 0 && Error.Code != ErrorCode.Busy;
                if (isIts)
                {
                    asked.Dequeue().Fail(new RefusedException(Error));
                    return MessageStep.Nothing;
                }
            }
            return MessageStep.Error;
        }

        MessageStep OnTelemetry(JsonValue message)
        {
            if (!Negotiation.Lists(Welcome, Capability.Telemetry)) return MessageStep.Nothing;
            try { Telemetry = Replies.Telemetry(message); }
            catch (ProtocolException broken)
            {
                Problem = "telemetry that " + broken.Message;
                return MessageStep.Nothing;
            }
            return MessageStep.Telemetry;
        }

        /// <summary>It may have been the reply that is awaited [REQ-13].</summary>
        MessageStep Unreadable(string why)
        {
            if (asked.Count > 0) return Close(why);
            Problem = why;
            return MessageStep.Nothing;
        }

        MessageStep Close(string why)
        {
            Problem = why;
            return MessageStep.Close;
        }
    }
}
