// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>The two services of a server.</summary>
    public enum ChannelName { Ipc, Message }

    /// <summary>What the client is connected to, at one moment.</summary>
    public struct ClientStatus
    {
        public ChannelState Ipc, Message;
        /// <summary>As the server names itself; null where it speaks 1.0, or none is there.</summary>
        public string Server;
        /// <summary>What both can do on the message channel; empty with a server of 1.0.</summary>
        public IReadOnlyList<string> Capabilities;
        /// <summary>The memory that is open; null where there is none.</summary>
        public InitPacket Images;
        /// <summary>What was last wrong, of either side, or null.</summary>
        public string Problem;
    }

    /// <summary>Something that was not asked for; see the classes below. Its text says what happened, for a person.</summary>
    public abstract class ClientEvent
    {
        internal ClientEvent(ChannelName channel) { Channel = channel; }

        public ChannelName Channel { get; private set; }

        public abstract override string ToString();
    }

    /// <summary>The server is known: from now on its version is spoken.</summary>
    public sealed class ConnectedEvent : ClientEvent
    {
        internal ConnectedEvent(ChannelName channel, Welcome welcome) : base(channel) { Welcome = welcome; }

        /// <summary>Null where the server speaks 1.0.</summary>
        public Welcome Welcome { get; private set; }

        public override string ToString()
        {
            return Channel + ": connected to " + (Welcome == null ? "a server of 1.0" : Welcome.Server.Name + " " + Welcome.Server.Version);
        }
    }

    /// <summary>A connection, or an attempt at one, came to nothing; another follows.</summary>
    public sealed class LostEvent : ClientEvent
    {
        internal LostEvent(ChannelName channel, string why) : base(channel) { Why = why; }

        public string Why { get; private set; }

        public override string ToString() { return Channel + ": " + Why + "; trying again"; }
    }

    /// <summary>There is memory for images, of another size perhaps; or none any more.</summary>
    public sealed class ImagesEvent : ClientEvent
    {
        internal ImagesEvent(InitPacket packet, string why) : base(ChannelName.Ipc)
        {
            Packet = packet;
            Why = why;
        }

        /// <summary>Null if the memory cannot be used.</summary>
        public InitPacket Packet { get; private set; }
        /// <summary>Why not; null where the server has none yet.</summary>
        public string Why { get; private set; }

        public override string ToString()
        {
            return Packet == null ? "no images: " + (Why ?? "the server has none yet") : "images of " + Packet.Meta.W + " x " + Packet.Meta.H;
        }
    }

    /// <summary>The server said what went wrong, and answered no request by it.</summary>
    public sealed class ErrorEvent : ClientEvent
    {
        internal ErrorEvent(ChannelName channel, Error error) : base(channel) { Error = error; }

        public Error Error { get; private set; }

        public override string ToString() { return Channel + ": the server says " + Error.Code + ": " + Error.Message; }
    }

    /// <summary>The server broke a rule, and was borne.</summary>
    public sealed class ProblemEvent : ClientEvent
    {
        internal ProblemEvent(ChannelName channel, string what) : base(channel) { What = what; }

        public string What { get; private set; }

        public override string ToString() { return Channel + ": the server broke a rule: " + What; }
    }

    /// <summary>Series that have a new value.</summary>
    public sealed class TelemetryEvent : ClientEvent
    {
        internal TelemetryEvent(Telemetry telemetry) : base(ChannelName.Message) { Telemetry = telemetry; }

        public Telemetry Telemetry { get; private set; }

        public override string ToString() { return "telemetry: " + string.Join(", ", Array.ConvertAll(Telemetry.Series, each => each.Name)); }
    }
}
